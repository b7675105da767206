// A pixel as a ray of the camera (mirror: atmoref/stages/camera.py).
//
// A point of the ray is eye + z d with z the eye-space depth, so that a plane parallel to the screen has one z.  Rows of
// every target are kept with row 0 at the bottom, as the mirror's buffers count them; Vulkan itself does not care.

struct Camera {
    tan_x: f32, tan_y: f32,     // half-extents of the image plane at z = 1
    step_x: f32, step_y: f32,   // 2 / width, 2 / height
    right_x: f32, right_y: f32, right_z: f32, up_x: f32, up_y: f32, up_z: f32,
    forward_x: f32, forward_y: f32, forward_z: f32,
    start_x: f32, start_y: f32, // of the left and lower edge, in half-extents: -1, or an interleaved image's
    depth_a: f32, depth_b: f32, // window depth of z is depth_a - depth_b / z
}
@group(0) @binding(0) var<uniform> camera: Camera;

struct Ray {
    ex: f32, ey: f32,           // on the image plane
    dx: f32, dy: f32, dz: f32,  // world direction per unit of z
    span: f32,                  // its length, 1 / cos psi
}

fn camera_ray(pixel: vec2f) -> Ray {
    var ray: Ray;
    ray.ex = (pixel.x * camera.step_x + camera.start_x) * camera.tan_x;
    ray.ey = (pixel.y * camera.step_y + camera.start_y) * camera.tan_y;
    ray.dx = sum(ray.ex * camera.right_x, ray.ey * camera.up_x, camera.forward_x);
    ray.dy = sum(ray.ex * camera.right_y, ray.ey * camera.up_y, camera.forward_y);
    ray.dz = sum(ray.ex * camera.right_z, ray.ey * camera.up_z, camera.forward_z);
    ray.span = sqrt(sum(ray.ex * ray.ex, ray.ey * ray.ey, 1.0));
    return ray;
}

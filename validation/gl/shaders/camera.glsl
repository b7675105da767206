// A pixel as a ray of the camera (mirror: atmoref/stages/camera.py).
//
// A point of the ray is eye + z d with z the eye-space depth, so that a plane parallel to the screen has one z.
// gl_FragCoord counts rows from the bottom and has pixel centres at + 1/2, as the mirror's buffers do.
//
// `precise` stands on every float that is stored in the end: without it a compiler may regroup products and fuse a
// multiplication with an addition, and results then differ in the last bit from build to build.

struct Camera {
    float tan_x, tan_y;     // half-extents of the image plane at z = 1
    float step_x, step_y;   // 2 / width, 2 / height
    float right_x, right_y, right_z, up_x, up_y, up_z, forward_x, forward_y, forward_z;
    float start_x, start_y; // of the left and lower edge, in half-extents: -1, or an interleaved image's
    float depth_a, depth_b; // window depth of z is depth_a - depth_b / z
};
uniform Camera camera;

struct Ray {
    float ex, ey;       // on the image plane
    float dx, dy, dz;   // world direction per unit of z
    float span;         // its length, 1 / cos psi
};

Ray camera_ray(vec2 pixel) {
    precise Ray ray;
    ray.ex = (pixel.x * camera.step_x + camera.start_x) * camera.tan_x;
    ray.ey = (pixel.y * camera.step_y + camera.start_y) * camera.tan_y;
    ray.dx = ray.ex * camera.right_x + ray.ey * camera.up_x + camera.forward_x;
    ray.dy = ray.ex * camera.right_y + ray.ey * camera.up_y + camera.forward_y;
    ray.dz = ray.ex * camera.right_z + ray.ey * camera.up_z + camera.forward_z;
    ray.span = sqrt(ray.ex * ray.ex + ray.ey * ray.ey + 1.0);
    return ray;
}

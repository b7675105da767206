// Pass 1: depth of the scene as the light sees it, a - b / w, of parallel light a + b w
// (mirror: atmoref/stages/shadow_map.py).

#include "plane.wgsl"
#include "ray_cast.wgsl"

override PARALLEL: bool = false;

struct Shadow {
    step: f32,  // 2 / size
    right_x: f32, right_y: f32, right_z: f32, up_x: f32, up_y: f32, up_z: f32,  // the light's camera
    axis_x: f32, axis_y: f32, axis_z: f32,
    near: f32, depth_a: f32, depth_b: f32,
}
@group(0) @binding(14) var<uniform> shadow: Shadow;

@fragment
fn main(given: Fragment) -> @builtin(frag_depth) f32 {
    let x = given.position.x * shadow.step - 1.0;
    let y = given.position.y * shadow.step - 1.0;
    let across = vec3f(
        x * shadow.right_x + y * shadow.up_x,
        x * shadow.right_y + y * shadow.up_y,
        x * shadow.right_z + y * shadow.up_z,
    );
    let axis = vec3f(shadow.axis_x, shadow.axis_y, shadow.axis_z);
    var hit: Hit;
    if PARALLEL {
        hit = nearest_hit_from(across, axis);
    } else {
        hit = nearest_hit(vec3f(kept(across.x), kept(across.y), kept(across.z)) + axis);
    }
    let w = max(hit.t, shadow.near);
    let deep = select(shadow.depth_a - shadow.depth_b / w, shadow.depth_a + shadow.depth_b * w, PARALLEL);
    return select(1.0, clamp(deep, 0.0, 1.0), hit.id >= 0);
}

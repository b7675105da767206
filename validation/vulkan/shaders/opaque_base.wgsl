// Pass 2: nearest depth, and the ambient term I_a of eq. (1) (mirror: atmoref/stages/opaque.py, opaque_base).

#include "plane.wgsl"
#include "camera.wgsl"
#include "ray_cast.wgsl"
#include "surface.wgsl"
#include "elementary.wgsl"

override SATURATING_AMBIENT: bool = false;

struct Base {
    @location(0) colour: vec4f,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn main(given: Fragment) -> Base {
    let ray = camera_ray(given.position.xy);
    let hit = nearest_hit(vec3f(ray.dx, ray.dy, ray.dz));
    let window = clamp(camera.depth_a - camera.depth_b / max(hit.t, 1e-6), 0.0, 1.0);
    var ambient = vec3f(surface.ambient_r, surface.ambient_g, surface.ambient_b);
    if SATURATING_AMBIENT {
        let t = min(hit.t * ray.span, FAR);
        ambient.r = ambient.r * (1.0 - mirror_exp(t * surface.sigma_r * -1.0));
        ambient.g = ambient.g * (1.0 - mirror_exp(t * surface.sigma_g * -1.0));
        ambient.b = ambient.b * (1.0 - mirror_exp(t * surface.sigma_b * -1.0));
    }
    return Base(vec4f(ambient, 0.0), select(window, 1.0, hit.id < 0));
}

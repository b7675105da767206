// Pass 3, blended ONE, ONE: Lambertian reflection of one light through fog, I_b e^(-sigma_t T) of eq. (1)
// (mirror: atmoref/stages/opaque.py, opaque_light).

#include "plane.wgsl"
#include "camera.wgsl"
#include "ray_cast.wgsl"
#include "spot_light.wgsl"
#include "surface.wgsl"
#include "elementary.wgsl"
#include "phase_function.wgsl"

override PRINTED_FOG: bool = false;

@group(0) @binding(15) var<storage, read> albedo: array<f32>;  // three an object

@fragment
fn main(given: Fragment) -> @location(0) vec4f {
    let ray = camera_ray(given.position.xy);
    let along = vec3f(ray.dx, ray.dy, ray.dz);
    let hit = nearest_hit(along);
    if hit.id < 0 {
        discard;
    }
    let z = hit.t;
    let lit = illuminate(ray, light_ray(ray), z, hit.id);
    var way = along * z + vec3f(spot.from_x, spot.from_y, spot.from_z);
    var distance_m = max(sqrt(inner(way, way)), 1e-6);
    var path = distance_m;
    if PARALLEL {
        way = vec3f(spot.axis_x, spot.axis_y, spot.axis_z);  // E_0 arrives as it is (D-E13)
        distance_m = 1.0;
        path = 0.0;
    }
    let facing = inner(hit.n, way) / distance_m * -1.0;
    if !(facing > 0.0) {
        discard;
    }
    let t = z * ray.span;
    var fog = vec3f(
        mirror_exp(t * surface.sigma_r * -1.0),
        mirror_exp(t * surface.sigma_g * -1.0),
        mirror_exp(t * surface.sigma_b * -1.0),
    );
    let reach = vec3f(
        mirror_exp(path * surface.sigma_r * -1.0),
        mirror_exp(path * surface.sigma_g * -1.0),
        mirror_exp(path * surface.sigma_b * -1.0),
    );
    if PRINTED_FOG {
        let mu = inner(along, way) / (distance_m * ray.span) * -1.0;
        let peak = phase_function(surface.g, mu) / (distance_m * distance_m);
        fog = fog * vec3f(surface.source_r, surface.source_g, surface.source_b) * peak * reach;
    }
    let e = kept(facing / (distance_m * distance_m) * 0.3183098861837907);
    let at = 3u * u32(max(hit.id, 0));
    let colour = vec3f(albedo[at], albedo[at + 1u], albedo[at + 2u]);
    let intensity = vec3f(surface.intensity_r, surface.intensity_g, surface.intensity_b);
    let lit_share = lit * e;
    return vec4f(lit_share * (fog * intensity * reach * colour), 0.0);
}

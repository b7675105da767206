// Pass 5, blended ONE, ONE into the frame: one main plane, f_h c_k q(u, v), eq. (9)
// (mirror: atmoref/stages/main_plane.py), with coordinates per pixel.

#include "plane.wgsl"
#include "camera.wgsl"
#include "slab.wgsl"
#include "elementary.wgsl"
#include "phase_function.wgsl"
#include "sunlight.wgsl"

override PARALLEL: bool = false;
override GREY_FOG: bool = false;
override COSINE: bool = false;
override Q_REST: bool = false;

@group(0) @binding(12) var smooth_filter: sampler;
@group(0) @binding(16) var q_map: texture_2d<f32>;
@group(0) @binding(17) var q_rest: texture_2d<f32>;
@group(0) @binding(18) var fast_map: texture_2d<f32>;  // f_h of this slab, one texel a pixel

fn extinction(t: f32) -> vec3f {
    let red = mirror_exp(t * slab.sigma_r * -1.0);
    if GREY_FOG {
        return vec3f(red);
    }
    return vec3f(red, mirror_exp(t * slab.sigma_g * -1.0), mirror_exp(t * slab.sigma_b * -1.0));
}

fn of_fog(texel: vec4f) -> vec3f {
    return select(texel.rgb, vec3f(texel.r), GREY_FOG);
}

@fragment
fn main(given: Fragment) -> @location(0) vec4f {
    let fast = textureLoad(fast_map, vec2i(given.position.xy), 0).rgb;
    if !(fast.r > 0.0 || fast.g > 0.0 || fast.b > 0.0) {
        discard;
    }
    let ray = camera_ray(given.position.xy);
    let t = ray.span * planes[given.plane].z;
    var slow = extinction(t);
    if PARALLEL {
        slow = slow * sunlight(ray);
    } else {
        let across = vec3f(
            sum(ray.ex * slab.cross_ax, ray.ey * slab.cross_bx, slab.cross_cx),
            sum(ray.ex * slab.cross_ay, ray.ey * slab.cross_by, slab.cross_cy),
            sum(ray.ex * slab.cross_az, ray.ey * slab.cross_bz, slab.cross_cz),
        );
        let v = sqrt(inner(across, across)) / ray.span;
        let from_light = vec3f(slab.from_x, slab.from_y, slab.from_z);
        let u = inner(vec3f(ray.dx, ray.dy, ray.dz), from_light) / ray.span + t;
        if COSINE {
            slow = slow * ray.span;
        }
        let at = clamp(vec2f(u * slab.scale_u + slab.offset_u, v * slab.scale_v + slab.offset_v), vec2f(0.0), vec2f(1.0));
        var q = of_fog(textureSampleLevel(q_map, smooth_filter, at, 0.0)) * slab.range;
        if Q_REST {
            q = q + of_fog(textureSampleLevel(q_rest, smooth_filter, at, 0.0)) * slab.rest;
        }
        slow = slow * q;
    }
    return vec4f(slow * fast, 0.0);
}

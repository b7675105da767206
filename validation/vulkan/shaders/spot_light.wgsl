// Light map and shadow map projected onto a point of a view ray (mirror: atmoref/stages/spot_light.py).
//
// The texture matrix times the camera's is linear in the pixel and in z: (u w, v w, w) = row z + offset.  What the paper
// calls projective texture mapping is the division by w; it is done once, u = (u w) (1 / w).
// Of the sun (PARALLEL) u, v and w are linear themselves; without a window (UNBOUNDED) it shines beyond its maps, too.

override PARALLEL: bool = false;
override UNBOUNDED: bool = false;
override GREY_LIGHT: bool = false;

struct Spot {
    u_x: f32, u_y: f32, u_z: f32, u_0: f32,
    v_x: f32, v_y: f32, v_z: f32, v_0: f32,
    w_x: f32, w_y: f32, w_z: f32, w_0: f32,
    from_x: f32, from_y: f32, from_z: f32,    // eye - light
    axis_x: f32, axis_y: f32, axis_z: f32,    // the sun's
    least_w: f32,                             // nearer than this is behind the light
    depth_a: f32, depth_b: f32, bias: f32,    // window depth of the shadow map; d(window depth) = bias / w^2
}
@group(0) @binding(8) var<uniform> spot: Spot;
@group(0) @binding(9) var shadow_map: texture_depth_2d;
@group(0) @binding(10) var compare: sampler_comparison;  // <=, linear (percentage-closer) or nearest
@group(0) @binding(11) var light_map: texture_2d<f32>;
@group(0) @binding(12) var smooth_filter: sampler;
@group(0) @binding(13) var<storage, read> light_grounds: array<Ground>;  // heights over the light's origin

struct LightRay { u: f32, v: f32, w: f32 }  // texture coordinates times w, per unit of z

fn light_ray(ray: Ray) -> LightRay {
    return LightRay(
        sum(ray.ex * spot.u_x, ray.ey * spot.u_y, spot.u_z),
        sum(ray.ex * spot.v_x, ray.ey * spot.v_y, spot.v_z),
        sum(ray.ex * spot.w_x, ray.ey * spot.w_y, spot.w_z),
    );
}

// Returns I_l H at eye + z d; 0 outside the light's pyramid and in shadow.  `own` is the object of a surface, -1 in air.
fn illuminate(ray: Ray, light: LightRay, z: f32, own: i32) -> vec3f {
    let w = light.w * z + spot.w_0;
    var u = light.u * z + spot.u_0;
    var v = light.v * z + spot.v_0;
    var reference = w * spot.depth_b + spot.depth_a;
    if !PARALLEL {
        let iw = 1.0 / max(w, spot.least_w);
        u = u * iw;
        v = v * iw;
        reference = spot.depth_a - (spot.depth_b + spot.bias * iw) * iw;
    }
    let on_map = u >= 0.0 && u <= 1.0 && v >= 0.0 && v <= 1.0;
    if UNBOUNDED {
        u = clamp(u, 0.0, 1.0);
        v = clamp(v, 0.0, 1.0);
    } else if !(on_map && w >= spot.least_w) {
        return vec3f(0.0);
    }
    var visible = textureSampleCompareLevel(shadow_map, compare, vec2f(u, v), reference);
    if UNBOUNDED {
        visible = select(1.0, visible, on_map);
        for (var i = 0u; i < counts.light_grounds; i++) {  // they have no end: their other side is dark beyond the map
            let above = (ray.dy * z + spot.from_y) - light_grounds[i].height;
            if above * spot.axis_y > 0.0 && own != light_grounds[i].id {
                visible = 0.0;
            }
        }
    }
    if visible <= 0.0 {
        return vec3f(0.0);
    }
    let texel = textureSampleLevel(light_map, smooth_filter, vec2f(u, v), 0.0).rgb;
    return select(texel, vec3f(texel.r), GREY_LIGHT) * visible;
}

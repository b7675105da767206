#version 430
// Pass 3, blended ONE, ONE: Lambertian reflection of one light through fog, I_b e^(-sigma_t T) of eq. (1)
// (mirror: atmoref/stages/opaque.py, opaque_light).

#include "camera.glsl"
#include "ray_cast.glsl"
#include "spot_light.glsl"
#include "surface.glsl"
#include "elementary.glsl"
#include "phase_function.glsl"

uniform vec3 albedo[OBJECTS];

precise out vec4 colour;

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy);
    Hit hit = nearest_hit(vec3(ray.dx, ray.dy, ray.dz));
    if (hit.id < 0) {
        discard;
    }
    precise float z = hit.t;
    precise vec3 lit = illuminate(ray, light_ray(ray), z, hit.id);
    precise float x = ray.dx * z + spot.from_x;
    precise float y = ray.dy * z + spot.from_y;
    precise float w = ray.dz * z + spot.from_z;
    precise float distance_m = max(sqrt(x * x + y * y + w * w), 1e-6);
    precise float path = distance_m;
#if PARALLEL
    x = spot.axis_x;  // E_0 arrives as it is (D-E13)
    y = spot.axis_y;
    w = spot.axis_z;
    distance_m = 1.0;
    path = 0.0;
#endif
    precise float facing = (hit.n.x * x + hit.n.y * y + hit.n.z * w) / distance_m * -1.0;
    if (!(facing > 0.0)) {
        discard;
    }
    precise float t = z * ray.span;
    precise vec3 fog;
    fog.r = mirror_exp(t * surface.sigma_r * -1.0);
    fog.g = mirror_exp(t * surface.sigma_g * -1.0);
    fog.b = mirror_exp(t * surface.sigma_b * -1.0);
    precise vec3 reach;
    reach.r = mirror_exp(path * surface.sigma_r * -1.0);
    reach.g = mirror_exp(path * surface.sigma_g * -1.0);
    reach.b = mirror_exp(path * surface.sigma_b * -1.0);
#if PRINTED_FOG
    precise float mu = (ray.dx * x + ray.dy * y + ray.dz * w) / (distance_m * ray.span) * -1.0;
    precise float peak = phase_function(surface.g, mu) / (distance_m * distance_m);
    fog.r = fog.r * surface.source_r * peak * reach.r;
    fog.g = fog.g * surface.source_g * peak * reach.g;
    fog.b = fog.b * surface.source_b * peak * reach.b;
#endif
    precise float e = facing / (distance_m * distance_m) * 0.3183098861837907;
    precise vec3 shade;
    shade.r = fog.r * surface.intensity_r * reach.r * albedo[hit.id].r;
    shade.g = fog.g * surface.intensity_g * reach.g * albedo[hit.id].g;
    shade.b = fog.b * surface.intensity_b * reach.b * albedo[hit.id].b;
    precise vec3 lit_share = lit * e;
    colour = vec4(lit_share * shade, 0.0);
}

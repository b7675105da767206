#version 430
// The previous method (sec. 4.1), blended ONE, ONE into the frame: g dt of one plane times light map times shadow, eq. (3)
// (mirror: atmoref/stages/vertex_planes.py).

#include "camera.glsl"
#include "spot_light.glsl"
#include "slab.glsl"
#include "elementary.glsl"
#include "phase_function.glsl"

uniform float plane_z;

#if VERTEX == 1
noperspective in vec2 mesh_uv;
noperspective in vec3 mesh_colour;
#elif VERTEX == 2
#include "mesh_corner.glsl"
#endif

precise out vec4 colour;

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy);
    precise vec3 lit = illuminate(ray, light_ray(ray), plane_z, -1);
    precise vec3 source;
#if VERTEX == 2
    vec2 mesh_uv;
    vec3 mesh_colour;
    interpolate(gl_FragCoord.xy, mesh_uv, mesh_colour);
#endif
#if VERTEX
    source = mesh_colour;
#else
    precise float x = ray.dx * plane_z + slab.from_x;
    precise float y = ray.dy * plane_z + slab.from_y;
    precise float w = ray.dz * plane_z + slab.from_z;
    precise float distance_m = max(sqrt(x * x + y * y + w * w), 1e-6);
    precise float mu = (ray.dx * x + ray.dy * y + ray.dz * w) / (distance_m * ray.span) * -1.0;
    precise float path = distance_m + plane_z * ray.span;
#if PARALLEL  // neither 1 / s^2 nor a way from the light (D-E13)
    mu = (ray.dx * slab.axis_x + ray.dy * slab.axis_y + ray.dz * slab.axis_z) / ray.span * -1.0;
    distance_m = 1.0;
    path = plane_z * ray.span;
#endif
    precise float dt = slab.dt;
#if COSINE
    dt = dt * ray.span;
#endif
    precise float part = phase_function(slab.g, mu * slab.cosine) / (distance_m * distance_m) * dt;
    source = vec3(slab.source_r * part * mirror_exp(path * slab.sigma_r * -1.0));
#if !GREY_FOG
    source.g = slab.source_g * part * mirror_exp(path * slab.sigma_g * -1.0);
    source.b = slab.source_b * part * mirror_exp(path * slab.sigma_b * -1.0);
#endif
#endif
    colour = vec4(source * lit, 0.0);
}

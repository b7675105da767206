#version 430
// Pass 5, blended ONE, ONE into the frame: one main plane, f_h c_k q(u, v), eq. (9)
// (mirror: atmoref/stages/main_plane.py).  With VERTEX the coordinates come from the plane's mesh, as published.

#include "camera.glsl"
#include "slab.glsl"
#include "elementary.glsl"
#include "phase_function.glsl"
#include "sunlight.glsl"

uniform sampler2D q_map;
uniform sampler2D q_rest;
uniform sampler2D fast_map;  // f_h of this slab, one texel a pixel
uniform float plane_z;

#if VERTEX == 1
noperspective in vec2 mesh_uv;
noperspective in vec3 mesh_colour;
#elif VERTEX == 2
#include "mesh_corner.glsl"
#endif

precise out vec4 colour;

void main() {
    precise vec3 fast = texelFetch(fast_map, ivec2(gl_FragCoord.xy), 0).rgb;
    if (!(fast.r > 0.0 || fast.g > 0.0 || fast.b > 0.0)) {
        discard;
    }
    precise float u, v;
    precise vec3 c;
#if VERTEX == 2
    vec2 mesh_uv;
    vec3 mesh_colour;
    interpolate(gl_FragCoord.xy, mesh_uv, mesh_colour);
#endif
#if VERTEX
    u = mesh_uv.x;
    v = mesh_uv.y;
    c = mesh_colour;
#else
    Ray ray = camera_ray(gl_FragCoord.xy);
#if PARALLEL
    precise float t = ray.span * plane_z;
#else
    precise float cx = ray.ex * slab.cross_ax + ray.ey * slab.cross_bx + slab.cross_cx;
    precise float cy = ray.ex * slab.cross_ay + ray.ey * slab.cross_by + slab.cross_cy;
    precise float cz = ray.ex * slab.cross_az + ray.ey * slab.cross_bz + slab.cross_cz;
    v = sqrt(cx * cx + cy * cy + cz * cz) / ray.span;
    precise float along = (ray.dx * slab.from_x + ray.dy * slab.from_y + ray.dz * slab.from_z) / ray.span;
    precise float t = ray.span * plane_z;
    u = along + t;
#endif
    c = vec3(mirror_exp(t * slab.sigma_r * -1.0));
#if !GREY_FOG
    c.g = mirror_exp(t * slab.sigma_g * -1.0);
    c.b = mirror_exp(t * slab.sigma_b * -1.0);
#endif
#if PARALLEL
    c = c * sunlight(ray);
#elif COSINE
    c = c * ray.span;
#endif
#endif
#if PARALLEL
    precise vec3 slow = c;
#else
    precise float su = clamp(u * slab.scale_u + slab.offset_u, 0.0, 1.0);
    precise float sv = clamp(v * slab.scale_v + slab.offset_v, 0.0, 1.0);
#if GREY_FOG
    precise vec3 q = vec3(textureLod(q_map, vec2(su, sv), 0.0).r * slab.range);
#if Q_REST
    q = vec3(q.r + textureLod(q_rest, vec2(su, sv), 0.0).r * slab.rest);
#endif
#else
    precise vec3 q = textureLod(q_map, vec2(su, sv), 0.0).rgb * slab.range;
#if Q_REST
    q = q + textureLod(q_rest, vec2(su, sv), 0.0).rgb * slab.rest;
#endif
#endif
    precise vec3 slow = c * q;
#endif
    colour = vec4(slow * fast, 0.0);
}

#version 430
// Pass 2: nearest depth, and the ambient term I_a of eq. (1) (mirror: atmoref/stages/opaque.py, opaque_base).

#include "camera.glsl"
#include "ray_cast.glsl"
#include "surface.glsl"
#include "elementary.glsl"

precise out vec4 colour;

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy);
    Hit hit = nearest_hit(vec3(ray.dx, ray.dy, ray.dz));
    precise float window = min(max(camera.depth_a - camera.depth_b / max(hit.t, 1e-6), 0.0), 1.0);
    gl_FragDepth = hit.id < 0 ? 1.0 : window;
    precise vec3 ambient = vec3(surface.ambient_r, surface.ambient_g, surface.ambient_b);
#if SATURATING_AMBIENT
    precise float t = min(hit.t * ray.span, FAR);
    ambient.r = ambient.r * (1.0 - mirror_exp(t * surface.sigma_r * -1.0));
    ambient.g = ambient.g * (1.0 - mirror_exp(t * surface.sigma_g * -1.0));
    ambient.b = ambient.b * (1.0 - mirror_exp(t * surface.sigma_b * -1.0));
#endif
    colour = vec4(ambient, 0.0);
}

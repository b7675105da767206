#version 430
// Pass 4, blended ONE, ONE into f_h: one sub-plane, light map times shadow times its share, eq. (10)
// (mirror: atmoref/stages/sub_plane.py).  The depth test keeps what lies in front of the surfaces.

#include "camera.glsl"
#include "spot_light.glsl"

uniform float plane_z;
uniform float share;

precise out vec4 colour;

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy);
    precise vec3 lit = illuminate(ray, light_ray(ray), plane_z, -1);
    colour = vec4(lit * share, 0.0);
}

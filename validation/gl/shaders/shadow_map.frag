#version 430
// Pass 1: depth of the scene as the light sees it, a - b / w, of parallel light a + b w
// (mirror: atmoref/stages/shadow_map.py).

#include "ray_cast.glsl"

struct Shadow {
    float step;  // 2 / size
    float right_x, right_y, right_z, up_x, up_y, up_z, axis_x, axis_y, axis_z;  // the light's camera
    float near, depth_a, depth_b;
};
uniform Shadow shadow;

void main() {
    precise float x = gl_FragCoord.x * shadow.step - 1.0;
    precise float y = gl_FragCoord.y * shadow.step - 1.0;
    precise vec3 across;
    across.x = x * shadow.right_x + y * shadow.up_x;
    across.y = x * shadow.right_y + y * shadow.up_y;
    across.z = x * shadow.right_z + y * shadow.up_z;
    vec3 axis = vec3(shadow.axis_x, shadow.axis_y, shadow.axis_z);
#if PARALLEL
    Hit hit = nearest_hit_from(across, axis);
    precise float w = max(hit.t, shadow.near);
    precise float window = min(max(shadow.depth_a + shadow.depth_b * w, 0.0), 1.0);
#else
    precise vec3 d = across + axis;
    Hit hit = nearest_hit(d);
    precise float w = max(hit.t, shadow.near);
    precise float window = min(max(shadow.depth_a - shadow.depth_b / w, 0.0), 1.0);
#endif
    gl_FragDepth = hit.id >= 0 ? window : 1.0;
}

// Light map and shadow map projected onto a point of a view ray (mirror: atmoref/stages/spot_light.py).
//
// The texture matrix times the camera's is linear in the pixel and in z: (u w, v w, w) = row z + offset.  What the paper
// calls projective texture mapping is the division by w; it is done once, u = (u w) (1 / w), as textureProj does here.
// Of the sun (PARALLEL) u, v and w are linear themselves; without a window (UNBOUNDED) it shines beyond its maps, too.

struct Spot {
    float u_x, u_y, u_z, u_0, v_x, v_y, v_z, v_0, w_x, w_y, w_z, w_0;
    float from_x, from_y, from_z;   // eye - light
    float axis_x, axis_y, axis_z;   // the sun's
    float least_w;                  // nearer than this is behind the light
    float depth_a, depth_b, bias;   // window depth of the shadow map; d(window depth) = bias / w^2
};
uniform Spot spot;

uniform sampler2DShadow shadow_map;  // compare mode <=, LINEAR (percentage-closer) or NEAREST
uniform sampler2D light_map;
#if UNBOUNDED && LIGHT_GROUNDS
uniform float light_grounds[LIGHT_GROUNDS];  // height over the light's origin
uniform int light_ground_ids[LIGHT_GROUNDS];
#endif

struct LightRay { float u, v, w; };  // texture coordinates times w, per unit of z

LightRay light_ray(Ray ray) {
    precise LightRay light;
    light.u = ray.ex * spot.u_x + ray.ey * spot.u_y + spot.u_z;
    light.v = ray.ex * spot.v_x + ray.ey * spot.v_y + spot.v_z;
    light.w = ray.ex * spot.w_x + ray.ey * spot.w_y + spot.w_z;
    return light;
}

// Returns I_l H at eye + z d; 0 outside the light's pyramid and in shadow.  `own` is the object of a surface, -1 in the air.  A fragment without light may as well be
// discarded, as soon as that is known: where a whole block of them is, llvmpipe skips the texture reads and the blend.
#if DISCARD
#define DARK discard
#else
#define DARK return vec3(0.0)
#endif

vec3 illuminate(Ray ray, LightRay light, float z, int own) {
    precise float w = light.w * z + spot.w_0;
#if PARALLEL
    precise float u = light.u * z + spot.u_0;
    precise float v = light.v * z + spot.v_0;
    precise float reference = w * spot.depth_b + spot.depth_a;
#else
    precise float iw = 1.0 / max(w, spot.least_w);
    precise float u = (light.u * z + spot.u_0) * iw;
    precise float v = (light.v * z + spot.v_0) * iw;
    precise float reference = spot.depth_a - (spot.depth_b + spot.bias * iw) * iw;
#endif
    bool on_map = u >= 0.0 && u <= 1.0 && v >= 0.0 && v <= 1.0;
#if UNBOUNDED
    u = clamp(u, 0.0, 1.0);
    v = clamp(v, 0.0, 1.0);
#else
    if (!(on_map && w >= spot.least_w)) {
        DARK;
    }
#endif
    precise float visible = textureLod(shadow_map, vec3(u, v, reference), 0.0);
#if UNBOUNDED
    visible = on_map ? visible : 1.0;
#if LIGHT_GROUNDS
    for (int i = 0; i < LIGHT_GROUNDS; i++) {  // they have no end, so their other side is dark beyond the map as well
        precise float above = (ray.dy * z + spot.from_y) - light_grounds[i];
        if (above * spot.axis_y > 0.0 && own != light_ground_ids[i]) {
            visible = 0.0;
        }
    }
#endif
#endif
    if (visible <= 0.0) {
        DARK;
    }
#if GREY_LIGHT
    precise vec3 light_colour = vec3(textureLod(light_map, vec2(u, v), 0.0).r * visible);
#else
    precise vec3 light_colour = textureLod(light_map, vec2(u, v), 0.0).rgb * visible;
#endif
    return light_colour;
}

// Light map and shadow map projected onto a point of a view ray (mirror: atmoref/stages/spot_light.py).
//
// The texture matrix times the camera's is linear in the pixel and in z: (u w, v w, w) = row z + offset.  What the paper
// calls projective texture mapping is the division by w; it is done once, u = (u w) (1 / w), as textureProj does here.

struct Spot {
    float u_x, u_y, u_z, u_0, v_x, v_y, v_z, v_0, w_x, w_y, w_z, w_0;
    float from_x, from_y, from_z;   // eye - light
    float least_w;                  // nearer than this is behind the light
    float depth_a, depth_b, bias;   // window depth of the shadow map; d(window depth) = bias / w^2
};
uniform Spot spot;

uniform sampler2DShadow shadow_map;  // compare mode <=, LINEAR (percentage-closer) or NEAREST
uniform sampler2D light_map;

struct LightRay { float u, v, w; };  // texture coordinates times w, per unit of z

LightRay light_ray(Ray ray) {
    precise LightRay light;
    light.u = ray.ex * spot.u_x + ray.ey * spot.u_y + spot.u_z;
    light.v = ray.ex * spot.v_x + ray.ey * spot.v_y + spot.v_z;
    light.w = ray.ex * spot.w_x + ray.ey * spot.w_y + spot.w_z;
    return light;
}

// Returns I_l H at eye + z d; 0 outside the light's pyramid and in shadow.  A fragment without light may as well be
// discarded, as soon as that is known: where a whole block of them is, llvmpipe skips the texture reads and the blend.
#if DISCARD
#define DARK discard
#else
#define DARK return vec3(0.0)
#endif

vec3 illuminate(LightRay light, float z) {
    precise float w = light.w * z + spot.w_0;
    precise float iw = 1.0 / max(w, spot.least_w);
    precise float u = (light.u * z + spot.u_0) * iw;
    precise float v = (light.v * z + spot.v_0) * iw;
    bool inside = w >= spot.least_w && u >= 0.0 && u <= 1.0 && v >= 0.0 && v <= 1.0;
    if (!inside) {
        DARK;
    }
    precise float reference = spot.depth_a - (spot.depth_b + spot.bias * iw) * iw;
    precise float visible = textureLod(shadow_map, vec3(u, v, reference), 0.0);
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

// Rays against spheres, boxes and ground planes (mirror: atmoref/stages/ray_cast.py).
//
// A GPU would rasterise triangles here.  The mirror knows analytic shapes, so the same question is asked per pixel, and
// depth goes out through gl_FragDepth.  Objects are relative to the origin of the rays (eye or light).

#define FAR 1e30

#if SPHERES
uniform vec4 spheres[SPHERES];         // centre, radius
uniform float sphere_scales[SPHERES];  // 1 / radius
uniform int sphere_ids[SPHERES];
#endif
#if BOXES
uniform vec3 box_lows[BOXES];
uniform vec3 box_highs[BOXES];
uniform int box_ids[BOXES];
#endif
#if GROUNDS
uniform float grounds[GROUNDS];        // height
uniform int ground_ids[GROUNDS];
#endif

struct Hit {
    float t;   // ray parameter, FAR where nothing is hit
    int id;    // -1: nothing
    vec3 n;    // unit normal towards the outside
};

float first_ahead(float enter, float leave) { return enter > 0.0 ? enter : leave; }

#if SPHERES
bool sphere_roots(vec4 s, vec3 d, out float enter, out float leave) {  // relative to where the ray starts
    precise float along = s.x * d.x + s.y * d.y + s.z * d.z;
    precise float cx = s.y * d.z - s.z * d.y;
    precise float cy = s.z * d.x - s.x * d.z;
    precise float cz = s.x * d.y - s.y * d.x;
    precise float dd = d.x * d.x + d.y * d.y + d.z * d.z;
    precise float rest = dd * s.w * s.w - (cx * cx + cy * cy + cz * cz);
    precise float root = sqrt(max(rest, 0.0));
    precise float near = (along - root) / dd;
    precise float far = (along + root) / dd;
    enter = near;
    leave = far;
    return rest > 0.0;
}
#endif

#if BOXES
void box_slab(float low, float high, float d, out float enter, out float leave) {
    precise float safe = (d < 1e-20 && d > -1e-20) ? 1e-20 : d;
    precise float a = low / safe;
    precise float b = high / safe;
    enter = min(a, b);
    leave = max(a, b);
}

float outward(bool test, float d) { return test ? (d > 0.0 ? -1.0 : 1.0) : 0.0; }
#endif

Hit nearest_hit_from(vec3 start, vec3 d) {
    precise Hit hit = Hit(FAR, -1, vec3(0.0));
#if SPHERES
    for (int i = 0; i < SPHERES; i++) {
        precise float enter, leave;
        bool meets = sphere_roots(vec4(spheres[i].xyz - start, spheres[i].w), d, enter, leave);
        precise float s = first_ahead(enter, leave);
        if (meets && s > 0.0 && s < hit.t) {
            hit.t = s;
            hit.id = sphere_ids[i];
            hit.n = (d * s - spheres[i].xyz) * sphere_scales[i];
        }
    }
#endif
#if BOXES
    for (int i = 0; i < BOXES; i++) {
        precise float x0, x1, y0, y1, z0, z1;
        box_slab(box_lows[i].x - start.x, box_highs[i].x - start.x, d.x, x0, x1);
        box_slab(box_lows[i].y - start.y, box_highs[i].y - start.y, d.y, y0, y1);
        box_slab(box_lows[i].z - start.z, box_highs[i].z - start.z, d.z, z0, z1);
        precise float enter = max(max(x0, y0), z0);
        precise float leave = min(min(x1, y1), z1);
        precise float s = first_ahead(enter, leave);
        if (enter < leave && s > 0.0 && s < hit.t) {
            bool on_x = x0 >= max(y0, z0);
            bool on_y = (y0 >= z0) && !on_x;
            hit.t = s;
            hit.id = box_ids[i];
            hit.n = vec3(outward(on_x, d.x), outward(on_y, d.y), outward(!(on_x || on_y), d.z));
        }
    }
#endif
#if GROUNDS
    for (int i = 0; i < GROUNDS; i++) {
        bool parallel = d.y < 1e-20 && d.y > -1e-20;
        precise float s = parallel ? FAR : (grounds[i] - start.y) / d.y;
        if (s > 0.0 && s < hit.t) {
            hit.t = s;
            hit.id = ground_ids[i];
            hit.n = vec3(0.0, d.y > 0.0 ? -1.0 : 1.0, 0.0);
        }
    }
#endif
    return hit;
}

Hit nearest_hit(vec3 d) { return nearest_hit_from(vec3(0.0), d); }  // differences to 0 cost nothing

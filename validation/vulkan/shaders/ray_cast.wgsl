// Rays against spheres, boxes and ground planes (mirror: atmoref/stages/ray_cast.py).
//
// A GPU would rasterise triangles here.  The mirror knows analytic shapes, so the same question is asked per pixel, and
// depth goes out through frag_depth.  Objects are relative to the origin of the rays (eye or light).

const FAR = 1e30;

struct Sphere { centre: vec3f, radius: f32, scale: f32, id: i32 }  // scale is 1 / radius
struct Box { low: vec3f, id: i32, high: vec3f }
struct Ground { height: f32, id: i32 }
struct Counts { spheres: u32, boxes: u32, grounds: u32, light_grounds: u32 }  // a buffer has one element at least

@group(0) @binding(2) var<uniform> counts: Counts;
@group(0) @binding(3) var<storage, read> spheres: array<Sphere>;
@group(0) @binding(4) var<storage, read> boxes: array<Box>;
@group(0) @binding(5) var<storage, read> grounds: array<Ground>;

struct Hit {
    t: f32,    // ray parameter, FAR where nothing is hit
    id: i32,   // -1: nothing
    n: vec3f,  // unit normal towards the outside
}

struct Roots { meets: bool, enter: f32, leave: f32 }

fn sphere_roots(c: vec3f, radius: f32, d: vec3f) -> Roots {  // centre relative to where the ray starts
    let along = inner(c, d);
    let across = vec3f(c.y * d.z - c.z * d.y, c.z * d.x - c.x * d.z, c.x * d.y - c.y * d.x);
    let dd = inner(d, d);
    let rest = kept(dd * radius) * radius - inner(across, across);
    let root = sqrt(max(rest, 0.0));
    return Roots(rest > 0.0, (along - root) / dd, (along + root) / dd);
}

fn box_slab(low: f32, high: f32, d: f32) -> vec2f {  // where the ray enters and leaves
    let safe = select(d, 1e-20, d < 1e-20 && d > -1e-20);
    let a = low / safe;
    let b = high / safe;
    return vec2f(min(a, b), max(a, b));
}

fn outward(test: bool, d: f32) -> f32 {
    return select(0.0, select(1.0, -1.0, d > 0.0), test);
}

fn nearest_hit_from(start: vec3f, d: vec3f) -> Hit {
    var hit = Hit(FAR, -1, vec3f(0.0));
    for (var i = 0u; i < counts.spheres; i++) {
        let ball = spheres[i];
        let roots = sphere_roots(ball.centre - start, ball.radius, d);
        let s = select(roots.leave, roots.enter, roots.enter > 0.0);
        if roots.meets && s > 0.0 && s < hit.t {
            hit = Hit(s, ball.id, (d * s - ball.centre) * ball.scale);
        }
    }
    for (var i = 0u; i < counts.boxes; i++) {
        let solid = boxes[i];
        let x = box_slab(solid.low.x - start.x, solid.high.x - start.x, d.x);
        let y = box_slab(solid.low.y - start.y, solid.high.y - start.y, d.y);
        let z = box_slab(solid.low.z - start.z, solid.high.z - start.z, d.z);
        let enter = max(max(x[0], y[0]), z[0]);
        let leave = min(min(x[1], y[1]), z[1]);
        let s = select(leave, enter, enter > 0.0);
        if enter < leave && s > 0.0 && s < hit.t {
            let on_x = x[0] >= max(y[0], z[0]);
            let on_y = y[0] >= z[0] && !on_x;
            hit = Hit(s, solid.id, vec3f(outward(on_x, d.x), outward(on_y, d.y), outward(!(on_x || on_y), d.z)));
        }
    }
    for (var i = 0u; i < counts.grounds; i++) {
        let level = d.y < 1e-20 && d.y > -1e-20;
        let s = select((grounds[i].height - start.y) / d.y, FAR, level);
        if s > 0.0 && s < hit.t {
            hit = Hit(s, grounds[i].id, vec3f(0.0, select(1.0, -1.0, d.y > 0.0), 0.0));
        }
    }
    return hit;
}

fn nearest_hit(d: vec3f) -> Hit {
    return nearest_hit_from(vec3f(0.0), d);
}

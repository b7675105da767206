// A plane that is parallel to the screen covers it; its window depth is all that the rasteriser needs to know.
// The draw's first instance says which plane of the light it is.

struct Plane {
    depth: f32,  // of the window, 0 to 1
    z: f32,      // eye-space depth, m
    share: f32,  // of a sub-plane
}
@group(0) @binding(1) var<storage, read> planes: array<Plane>;

// WGSL has no `precise`: a compiler may take a + (b + c) for (a + b) + c, or move a constant through products, and Mesa's
// does (through a select as well).  That is an ulp in one result of four or ten.  What is `kept` is computed as it stands:
// its bits are those that went in, for no depth is negative, which a compiler cannot foresee.
fn kept(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ (bitcast<u32>(planes[0].depth) >> 31u));
}

fn sum(a: f32, b: f32, c: f32) -> f32 {  // (a + b) + c
    return kept(a + b) + c;
}

fn inner(a: vec3f, b: vec3f) -> f32 {  // dot, in the mirror's order
    return sum(a.x * b.x, a.y * b.y, a.z * b.z);
}

struct Fragment {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) plane: u32,
}

@vertex
fn cover(@builtin(vertex_index) vertex: u32, @builtin(instance_index) plane: u32) -> Fragment {
    let corner = vec2f(f32(vertex & 1u), f32(vertex >> 1u)) * 2.0 - 1.0;
    return Fragment(vec4f(corner, planes[plane].depth, 1.0), plane);
}

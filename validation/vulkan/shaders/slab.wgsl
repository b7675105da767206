// The fog of one slab and its uniforms (mirror: atmoref/stages/main_plane.py).

struct Slab {
    dt: f32,
    sigma_r: f32, sigma_g: f32, sigma_b: f32,      // extinction, 1/m
    source_r: f32, source_g: f32, source_b: f32,   // rho F without the phase function, I_0 sigma_s
    g: f32, cosine: f32,
    scale_u: f32, offset_u: f32, scale_v: f32, offset_v: f32,  // texture coordinate of the q table = scale x + offset
    range: f32, rest: f32,                         // what 1 means in the table, and in the table of the rest
    from_x: f32, from_y: f32, from_z: f32,         // eye - light
    axis_x: f32, axis_y: f32, axis_z: f32,         // of the sun
    cross_ax: f32, cross_ay: f32, cross_az: f32,
    cross_bx: f32, cross_by: f32, cross_bz: f32,
    cross_cx: f32, cross_cy: f32, cross_cz: f32,
}
@group(0) @binding(7) var<uniform> slab: Slab;

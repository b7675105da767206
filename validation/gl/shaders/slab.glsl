// The fog of one slab and its uniforms (mirror: atmoref/stages/main_plane.py).

struct Slab {
    float dt;
    float sigma_r, sigma_g, sigma_b;      // extinction, 1/m
    float source_r, source_g, source_b;   // rho F without the phase function, I_0 sigma_s
    float g, cosine;
    float scale_u, offset_u, scale_v, offset_v;  // texture coordinate of the q table = scale x + offset
    float range, rest;                    // what 1 means in the table, and in the table of the rest
    float from_x, from_y, from_z;         // eye - light
    float axis_x, axis_y, axis_z;         // of the sun
    float cross_ax, cross_ay, cross_az, cross_bx, cross_by, cross_bz, cross_cx, cross_cy, cross_cz;
    float cells_x, cells_y;               // mesh cells per pixel
    float cell_x, cell_y;                 // mesh coordinate of the left and lower edge
};
uniform Slab slab;

// The mirror's interpolation between mesh vertices, written out (atmoref/stages/main_plane.py: mesh_corner, interpolate).
//
// With VERTEX 1 the rasteriser interpolates, by a rule of its own (validation/gl/interpolation.py).  With VERTEX 2 the
// fragment reads its triangle's vertices and interpolates as the mirror does: if pictures agree then and not before,
// interpolation is all that differs.

layout(std430, binding = 0) readonly buffer Attributes { float attributes[]; };  // plane, vertex: u, v, r, g, b
uniform int plane_index;

void interpolate(vec2 pixel, out vec2 uv, out vec3 colour) {
    precise float x = pixel.x * slab.cells_x + slab.cell_x;
    precise float y = pixel.y * slab.cells_y + slab.cell_y;
    precise float i = min(floor(x), float(MESH_X) - 1.0);
    precise float j = min(floor(y), float(MESH_Y) - 1.0);
    x = x - i;
    y = y - j;
    int first = int(j) * (MESH_X + 1) + int(i);
    bool lower = x + y <= 1.0;
    int a = lower ? first : first + MESH_X + 2;
    int b = lower ? first + 1 : first + MESH_X + 1;
    int c = lower ? first + MESH_X + 1 : first + 1;
    precise float wb = lower ? x : 1.0 - x;
    precise float wc = lower ? y : 1.0 - y;
    int start = plane_index * (MESH_X + 1) * (MESH_Y + 1);
    precise float found[5];
    for (int n = 0; n < 5; n++) {
        precise float va = attributes[5 * (start + a) + n];
        precise float vb = attributes[5 * (start + b) + n];
        precise float vc = attributes[5 * (start + c) + n];
        found[n] = va + wb * (vb - va) + wc * (vc - va);
    }
    uv = vec2(found[0], found[1]);
    colour = vec3(found[2], found[3], found[4]);
}

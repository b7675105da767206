#version 430
// The mesh of a plane: texture coordinates and colours are computed at its vertices and interpolated between them.

in vec2 corner;
in vec2 vertex_uv;
in vec3 vertex_colour;
uniform float plane_depth;

noperspective out vec2 mesh_uv;
noperspective out vec3 mesh_colour;

void main() {
    mesh_uv = vertex_uv;
    mesh_colour = vertex_colour;
    gl_Position = vec4(corner, plane_depth, 1.0);
}

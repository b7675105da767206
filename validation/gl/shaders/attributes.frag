#version 430
// Shows interpolated attributes as they are, for an RGBA32F target.

noperspective in vec2 mesh_uv;
noperspective in vec3 mesh_colour;

out vec4 colour;

void main() {
    colour = vec4(mesh_uv, mesh_colour.rg);
}

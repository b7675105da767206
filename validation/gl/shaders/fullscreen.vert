#version 430
// A plane that is parallel to the screen covers it; its window depth is all that the rasteriser needs to know.

in vec2 corner;
uniform float plane_depth;  // z of normalised device coordinates

void main() {
    gl_Position = vec4(corner, plane_depth, 1.0);
}

#version 430
// Puts the mirror's depth codes into the depth buffer, so that a stage can be judged on the mirror's own input.

uniform sampler2D codes;  // code / 16777215, which float32 holds closely enough to give the code back

void main() {
    gl_FragDepth = texelFetch(codes, ivec2(gl_FragCoord.xy), 0).r;
}

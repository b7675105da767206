// Puts the mirror's depth codes into a depth buffer, so that a stage can be judged on the mirror's own input.

#include "plane.wgsl"

@group(0) @binding(19) var codes: texture_2d<f32>;  // code / 16777215, which float32 holds closely enough

@fragment
fn main(given: Fragment) -> @builtin(frag_depth) f32 {
    return textureLoad(codes, vec2i(given.position.xy), 0).r;
}

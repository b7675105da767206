// Shows depths as they are, for an R32F target: WebGPU cannot copy out of a 24-bit depth buffer.

#include "plane.wgsl"

@group(0) @binding(20) var depths: texture_depth_2d;

@fragment
fn main(given: Fragment) -> @location(0) vec4f {
    return vec4f(textureLoad(depths, vec2i(given.position.xy), 0), 0.0, 0.0, 0.0);
}

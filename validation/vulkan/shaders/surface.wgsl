// Uniforms of the opaque scene as the camera sees it through fog (mirror: atmoref/stages/opaque.py).

struct Surface {
    sigma_r: f32, sigma_g: f32, sigma_b: f32,
    ambient_r: f32, ambient_g: f32, ambient_b: f32,
    intensity_r: f32, intensity_g: f32, intensity_b: f32,  // I_0, W/sr
    source_r: f32, source_g: f32, source_b: f32,
    g: f32,
}
@group(0) @binding(6) var<uniform> surface: Surface;

// Uniforms of the opaque scene as the camera sees it through fog (mirror: atmoref/stages/opaque.py).

struct Surface {
    float sigma_r, sigma_g, sigma_b;
    float ambient_r, ambient_g, ambient_b;
    float intensity_r, intensity_g, intensity_b;  // I_0, W/sr
    float source_r, source_g, source_b;
    float g;
};
uniform Surface surface;

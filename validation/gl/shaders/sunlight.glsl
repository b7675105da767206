// f_l of the sun without c_k: gamma (1 - exp(-sigma_t dt)) / sigma_t (D-E13; mirror: atmoref/stages/main_plane.py).

#if PARALLEL
float mean_transmittance(float x) {  // (1 - exp(-x)) / x without cancellation
    precise float series = 1.0 - x * 0.14285714285714285 * (1.0 - x * 0.125);
    series = 1.0 - x * 0.2 * (1.0 - x * 0.16666666666666666 * series);
    series = 1.0 - x * 0.5 * (1.0 - x * 0.3333333333333333 * (1.0 - x * 0.25 * series));
    precise float direct = (1.0 - mirror_exp(x * -1.0)) / max(x, 0.0625);
    return x < 0.0625 ? series : direct;
}

vec3 sunlight(Ray ray) {
    precise float mu = (ray.dx * slab.axis_x + ray.dy * slab.axis_y + ray.dz * slab.axis_z) / ray.span * -1.0;
    precise float dt = slab.dt;
#if COSINE
    dt = dt * ray.span;
#endif
    precise float peak = phase_function(slab.g, mu * slab.cosine) * dt;
    precise vec3 light = vec3(peak * slab.source_r * mean_transmittance(dt * slab.sigma_r));
#if !GREY_FOG
    light.g = peak * slab.source_g * mean_transmittance(dt * slab.sigma_g);
    light.b = peak * slab.source_b * mean_transmittance(dt * slab.sigma_b);
#endif
    return light;
}
#endif

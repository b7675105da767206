// f_l of the sun without c_k: gamma (1 - exp(-sigma_t dt)) / sigma_t (D-E13; mirror: atmoref/stages/main_plane.py).

fn mean_transmittance(x: f32) -> f32 {  // (1 - exp(-x)) / x without cancellation
    var series = 1.0 - kept(x * 0.14285714285714285) * (1.0 - x * 0.125);
    series = 1.0 - kept(x * 0.2) * (1.0 - kept(x * 0.16666666666666666) * series);
    series = 1.0 - kept(x * 0.5) * (1.0 - kept(x * 0.3333333333333333) * (1.0 - kept(x * 0.25) * series));
    let direct = (1.0 - mirror_exp(x * -1.0)) / max(x, 0.0625);
    return select(direct, series, x < 0.0625);
}

fn sunlight(ray: Ray) -> vec3f {
    let mu = inner(vec3f(ray.dx, ray.dy, ray.dz), vec3f(slab.axis_x, slab.axis_y, slab.axis_z)) / ray.span * -1.0;
    let dt = select(slab.dt, slab.dt * ray.span, COSINE);
    let peak = phase_function(slab.g, mu * slab.cosine) * dt;
    let red = peak * slab.source_r * mean_transmittance(dt * slab.sigma_r);
    if GREY_FOG {
        return vec3f(red);
    }
    let green = peak * slab.source_g * mean_transmittance(dt * slab.sigma_g);
    return vec3f(red, green, peak * slab.source_b * mean_transmittance(dt * slab.sigma_b));
}

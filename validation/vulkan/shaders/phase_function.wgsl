// Phase functions, 1/sr, normalised over the sphere; mu = 1 is forward (mirror: atmoref/optics/phase_functions.py).
// PHASE is the kind's code, fixed when the pipeline is built.

override PHASE: i32 = 0;

fn phase_function(g: f32, mu: f32) -> f32 {
    var value = 1.0;
    let d = (g - mu) * (g - mu) + (1.0 - mu) * (1.0 + mu);
    let x = (1.0 + mu) * 0.5;
    let x2 = x * x;
    let x4 = x2 * x2;
    let x8 = x4 * x4;
    let x16 = x8 * x8;
    if PHASE == 1 {         // Henyey-Greenstein
        value = (1.0 - g) * (1.0 + g) / (d * sqrt(d));
    } else if PHASE == 2 {  // Rayleigh
        value = 0.75 * (1.0 + mu * mu);
    } else if PHASE == 3 {  // hazy
        value = 0.5 + 4.5 * x8;
    } else if PHASE == 4 {  // murky
        value = 0.5 + 16.5 * (x16 * x16);
    } else if PHASE == 5 {  // Cornette-Shanks
        let top = 1.5 * ((1.0 - g) * (1.0 + g)) / (2.0 + g * g);
        value = top * (1.0 + mu * mu) / (d * sqrt(d));
    }
    return kept(value * 0.07957747154594767);
}

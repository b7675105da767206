// Phase functions, 1/sr, normalised over the sphere; mu = 1 is forward (mirror: atmoref/optics/phase_functions.py).
// PHASE is the kind's code, fixed when the shader is built.

float phase_function(float g, float mu) {
    precise float value = 1.0;
#if PHASE == 1 || PHASE == 5
    precise float d = (g - mu) * (g - mu) + (1.0 - mu) * (1.0 + mu);
#endif
#if PHASE == 1
    value = (1.0 - g) * (1.0 + g) / (d * sqrt(d));
#elif PHASE == 2
    value = 0.75 * (1.0 + mu * mu);
#elif PHASE == 3 || PHASE == 4
    precise float x = (1.0 + mu) * 0.5;
    precise float x2 = x * x;
    precise float x4 = x2 * x2;
    precise float x8 = x4 * x4;
#if PHASE == 3
    value = 0.5 + 4.5 * x8;
#else
    precise float x16 = x8 * x8;
    value = 0.5 + 16.5 * (x16 * x16);
#endif
#elif PHASE == 5
    precise float top = 1.5 * ((1.0 - g) * (1.0 + g)) / (2.0 + g * g);
    value = top * (1.0 + mu * mu) / (d * sqrt(d));
#endif
    return value * 0.07957747154594767;
}

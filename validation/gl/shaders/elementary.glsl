// exp with the mirror's bits (atmoref/elementary.py: make_exp, float32).
//
// GLSL leaves exp to the device: llvmpipe's own is wrong by up to 4e-7 of the value and agrees with the mirror in about
// one argument of four.  Only + - * and one rounding to an integer are needed to have the same one everywhere:
// x = k ln 2 + r, e^x = 2^k (1 + r + r^2 p(r)).  NATIVE_EXP builds with the device's, to see what that changes.

float mirror_exp(float x) {
#if NATIVE_EXP
    return exp(x);
#else
    precise float clamped = min(max(x, EXP_LEAST), EXP_MOST);
    precise float k = roundEven(clamped * 1.4426950408889634);
    precise float a = clamped - k * EXP_LN2_HIGH;
    precise float b = k * EXP_LN2_LOW;
    precise float r = a - b;
    precise float lost = (a - r) - b;
    precise float tail = ((((EXP_5 * r + EXP_4) * r + EXP_3) * r + EXP_2) * r + EXP_1) * r + EXP_0;
    precise float value = 1.0 + (r + (r * r * tail + lost));
    int n = int(k);
    int part = n >> 1;  // in two steps, so that underflow is gradual
    value = value * intBitsToFloat((part + 127) << 23);
    value = value * intBitsToFloat((n - part + 127) << 23);
    return value;
#endif
}

// exp with the mirror's bits (atmoref/elementary.py: make_exp, float32); the constants EXP_* are written by the driver.
//
// WGSL leaves exp to the device.  Only + - * and one rounding to an integer are needed to have the same one everywhere:
// x = k ln 2 + r, e^x = 2^k (1 + r + r^2 p(r)).

fn mirror_exp(x: f32) -> f32 {
    let clamped = min(max(x, EXP_LEAST), EXP_MOST);
    let k = round(clamped * 1.4426950408889634);
    let a = clamped - k * EXP_LN2_HIGH;
    let b = k * EXP_LN2_LOW;
    let r = a - b;
    let lost = (a - r) - b;
    let tail = ((((EXP_5 * r + EXP_4) * r + EXP_3) * r + EXP_2) * r + EXP_1) * r + EXP_0;
    let value = 1.0 + kept(r + (r * r * tail + lost));
    let n = i32(k);
    let part = n >> 1u;  // in two steps, so that underflow is gradual
    return value * bitcast<f32>((part + 127) << 23u) * bitcast<f32>((n - part + 127) << 23u);
}

// Profile `main` (spec.md, section 15): its tables, and integers that round down.
//
// This text is put in front of the shaders that need it. All numbers of these shaders are integers of 32 bits, signed
// or not, and where a product looks too large a comment says why it is not. So are the parameters: bit patterns.

@group(0) @binding(1) var<storage, read> tables: array<u32>;    // EXP2, LOGISTIC, LAPLACE of section 15.3, and (15-8)

const TOTAL = 0x4000u;          // 2^14, the sum of all frequencies

fn mantissa(v: i32) -> u32 {    // EXP2[v mod 1024]
    return tables[u32(v & 1023)];
}

// exp2(v, k) of (15-2), where that is below 2^31.
fn power(v: i32, k: i32) -> i32 {
    let shift = (v >> 10u) - 15 + k;
    return i32(select(mantissa(v) >> u32(clamp(-shift, 0, 31)), mantissa(v) << u32(clamp(shift, 0, 15)), shift >= 0));
}

// ⌊a / b⌋. Not by a % b, which NVIDIA's driver gets wrong below 0; |q b| is at most |a|.
// range: b > 0
fn floor_quotient(a: i32, b: i32) -> i32 {
    let q = a / b;
    return q - select(0, 1, q * b > a);
}

// The class j of n / D, (15-4): at most 2^28 + 2^12 is divided.
// range: step, which is D, is at least 1
fn class_of(n: vec3<i32>, step: i32) -> i32 {
    let k = min((abs(n) + step / 2) / step, vec3<i32>(1024));
    let energy = u32(k.x * k.x + k.y * k.y + k.z * k.z);
    // The largest j with 2 j - 1 <= log2 of the energy.
    return select(min((32 - i32(countLeadingZeros(energy))) / 2, 10), 0, energy == 0u);
}

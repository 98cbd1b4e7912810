// The parameters of states (spec.md, section 15.4), bit for bit: (15-5) in the arithmetic of binary32.wgsl, which stands
// in front, as do the texts of main_tables.wgsl.
//
//     pass               dispatch       bindings
//     state_parameters   splats / 256   0 1 2 3

@group(0) @binding(0) var<uniform> splat_count: u32;
@group(0) @binding(2) var<storage, read> state: array<i32>;                 // (splats, 8)
@group(0) @binding(3) var<storage, read_write> result: array<u32>;          // binary32, (splats, 8)

const K1 = 0x38a76e2bu;         // MAIN_K1, MAIN_K2, MAIN_K3
const K2 = 0x38cd0f39u;
const K3 = 0x386cc843u;
const TWO = 0x40000000u;
const TO_PIXELS = 0x3b800000u;  // 1/256
const TO_RATIO = 0x3a800000u;   // 1/1024

// The nearest binary32 of an integer.
fn from_signed(value: i32) -> u32 {
    return select(from_integer(u32(abs(value))) | select(0u, SIGN, value < 0), 0u, value == 0);
}

// 2^(v/1024): 16 bits, so it is exact.
fn power_of_two(v: i32) -> u32 {
    return rounded(0u, 143 + (v >> 10u), mantissa(v));
}

@compute @workgroup_size(256)
fn state_parameters(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= splat_count) {
        return;
    }
    let first = 8u * id.x;
    let l22 = power_of_two(state[first + 3u]);
    let g = power_of_two((-(state[first + 2u] + state[first + 3u])) >> 1u);
    let a = multiply(from_signed(state[first + 5u]), K1);
    let b = multiply(from_signed(state[first + 6u]), K2);
    let c = multiply(from_signed(state[first + 7u]), K3);
    result[first] = multiply(from_signed(state[first]), TO_PIXELS);          // a quotient by 256 is as exact
    result[first + 1u] = multiply(from_signed(state[first + 1u]), TO_PIXELS);
    result[first + 2u] = power_of_two(state[first + 2u]);
    result[first + 3u] = multiply(multiply(from_signed(state[first + 4u]), TO_RATIO), l22);
    result[first + 4u] = l22;
    result[first + 5u] = multiply(add(add(a, b), c), g);
    result[first + 6u] = multiply(subtract(a, multiply(TWO, c)), g);
    result[first + 7u] = multiply(add(subtract(a, b), c), g);
}

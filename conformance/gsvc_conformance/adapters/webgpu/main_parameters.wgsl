// The parameters of states (spec.md, section 15.4) as bit patterns, and their rendering work (section 5): integers only.
//
//     pass               dispatch       bindings
//     state_parameters   splats / 256   0 1 2 3      (15-5)
//     main_work          splats / 256   0 1 2 3      (5-2) of each splat
//
// The texts of main_tables.wgsl stand in front.

struct Told {
    splats: u32,
    width: i32,
    height: i32,
    halvings: u32,    // range: 0 to 3
}

@group(0) @binding(0) var<uniform> told: Told;
@group(0) @binding(2) var<storage, read> state: array<i32>;                 // (splats, 8)
@group(0) @binding(3) var<storage, read_write> result: array<u32>;          // binary32, (splats, 8); or work

const K = vec3<i32>(42862, 52495, 30308);    // MAIN_K

fn digits(p: u32) -> u32 {
    return 32u - countLeadingZeros(p);
}

// sign q 2^(e + k) with (q, e) = r24(p), as a bit pattern. No number here is subnormal or beyond binary32.
fn number(negative: bool, p: u32, k: i32) -> u32 {
    // range: at most 8, and at least 1 where 1 is subtracted
    let e = u32(max(i32(digits(p)) - 24, 0));
    var q = p;
    if (e > 0u) {
        q = (p + (1u << (e - 1u)) - 1u + ((p >> e) & 1u)) >> e;
    }
    let z = digits(q);    // 25 if q is 2^24. range: cut to 24
    let fraction = select(q << (24u - min(z, 24u)), 0u, z > 24u) & 0x7fffffu;
    let pattern = (u32(k + i32(e + z) + 126) << 23u) | fraction | select(0u, 0x80000000u, negative);
    return select(pattern, 0u, q == 0u);
}

// |t| G / 2^15 with G = EXP2[v mod 1024]: t is below 2^31, and so is what both parts add up to below 2^32.
fn weighted(t: i32, v: i32, s: u32) -> u32 {
    let G = mantissa(v);
    let magnitude = u32(abs(t));
    let p = (magnitude >> 15u) * G + (((magnitude & 0x7fffu) * G) >> 15u);
    return number(t < 0, p, i32(s) + (v >> 10u) - 29);
}

@compute @workgroup_size(256)
fn state_parameters(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= told.splats) {
        return;
    }
    let at = 8u * id.x;
    let x = state[at];
    let y = state[at + 1u];
    let a = state[at + 2u];
    let b = state[at + 3u];
    let shear = state[at + 4u];
    let n = vec3<i32>(state[at + 5u], state[at + 6u], state[at + 7u]);
    let largest = max(max(abs(n.x), abs(n.y)), abs(n.z));
    // range: at most 15, since colours are at most 2^28
    let s = u32(max(i32(digits(u32(largest))) - 14, 0));
    let shift = vec3<u32>(s);    // range: of s
    // ⌊n k / 2^s⌋: n >> s is below 2^14 in magnitude, what is left of n below 2^15.
    let P = (n >> shift) * K + (((n & vec3<i32>((1 << s) - 1)) * K) >> shift);
    let v = (-(a + b)) >> 1u;
    result[at] = number(x < 0, u32(abs(x)), -8);
    result[at + 1u] = number(y < 0, u32(abs(y)), -8);
    result[at + 2u] = number(false, mantissa(a), (a >> 10u) - 15);
    result[at + 3u] = number(shear < 0, u32(abs(shear)) * mantissa(b), (b >> 10u) - 25);
    result[at + 4u] = number(false, mantissa(b), (b >> 10u) - 15);
    result[at + 5u] = weighted(P.x + P.y + P.z, v, s);
    result[at + 6u] = weighted(P.x - 2 * P.z, v, s);
    result[at + 7u] = weighted(P.x - P.y + P.z, v, s);
}

// E_x from A, or e from B: below 2^23.
// range: v is -3072 to 13311
fn reach_of(v: i32) -> i32 {
    return i32((mantissa(v) * 54544u) >> u32(21 - (v >> 10u))) + 1;
}

fn side_of(middle: i32, reach: i32, size: i32) -> u32 {
    var filters = array<i32, 4>(0, 427, 953, 1953);
    let h = told.halvings;    // range: 0 to 3
    let far = reach + filters[h];
    let last = min((size + (1 << h) - 1) >> h, (middle + far + (256 << h) - 1) >> (8u + h));
    return u32(max(0, last - max(0, (middle - far) >> (8u + h))));
}

@compute @workgroup_size(256)
fn main_work(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= told.splats) {
        return;
    }
    let at = 8u * id.x;
    let m = 1024 + abs(state[at + 4u]);
    let e = reach_of(state[at + 3u]);
    let e_y = (e >> 10u) * m + (((e & 1023) * m) >> 10u) + 1;
    result[id.x] = side_of(state[at], reach_of(state[at + 2u]), told.width) * side_of(state[at + 1u], e_y, told.height);
}

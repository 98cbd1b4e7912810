// Deterministic rendering (spec.md, section 9.3): the same bytes on every machine.
//
//     pass                dispatch                              bindings
//     prepare, mark       as for bounded rendering
//     prepare_exactly     splat_count / 64                      0 1 8
//     sum_exactly         tiles_across, tiles_down              0 4 5 8
//     quantize_exactly    frame words / 256                     0 5 6
//
// In front of this text stand that of ../web/render.wgsl.js, whose bindings and tiles these passes share, and
// binary32.wgsl, whose operations take the place of those of WGSL, which promise no bits: every float below is a bit
// pattern. A pixel of a splat takes 18 products and 12 sums, each of about 50 integer operations: this is for
// comparing decoders, not for watching films. On a device that is known to neither fuse nor flush, and to round to
// nearest, f32 gives the same bits.

struct ExactSplat {
    x: u32,
    y: u32,
    r1: u32,
    r2: u32,
    l: u32,
    f: u32,
    color: array<u32, 3>,
}

@group(0) @binding(5) var<storage, read_write> exact_sums: array<u32>;    // the buffer of sums; as f32 it may lose bits
@group(0) @binding(8) var<storage, read_write> exact_splats: array<ExactSplat>;

const SUPPORT_SQUARED = 0x41315208u;    // K
const K1 = 0xbd7fffe4u;
const K2 = 0x3afff978u;
const K3 = 0xb82a3d40u;
const K4 = 0x3524c79fu;
const K5 = 0xb1c84634u;

// (9-3). A degenerate splat is in no mask, so what it gets here does not matter.
@compute @workgroup_size(64)
fn prepare_exactly(@builtin(global_invocation_id) id: vec3<u32>) {
    let n = id.x;
    if (n >= view.splat_count) {
        return;
    }
    let at = 8u * n;
    var splat: ExactSplat;
    splat.x = parameters[at];
    splat.y = parameters[at + 1u];
    splat.r1 = divide(ONE, parameters[at + 2u]);
    splat.r2 = divide(ONE, parameters[at + 4u]);
    splat.l = parameters[at + 3u];
    splat.f = splat.r2;
    if (parameters[at + 4u] > ONE) {    // l22 > 1: positive numbers compare as their bits
        splat.l = divide(splat.l, parameters[at + 4u]);
        splat.f = ONE;
    }
    for (var k = 0u; k < 3u; k++) {
        splat.color[k] = parameters[at + 5u + k];
    }
    exact_splats[n] = splat;
}

// i + 1/2.
fn centre_of(pixel: u32) -> u32 {
    return rounded(0u, 157, 2u * pixel + 1u);
}

// (9-4)
fn squared_distance(splat: ExactSplat, x: u32, y: u32) -> u32 {
    let u1 = multiply(subtract(x, splat.x), splat.r1);
    let u2 = subtract(multiply(subtract(y, splat.y), splat.r2), multiply(multiply(splat.l, u1), splat.f));
    return add(multiply(u1, u1), multiply(u2, u2));
}

// (9-5)
fn weight(m: u32) -> u32 {
    let t = multiply(m, m);
    let odd = add(multiply(K5, t), add(multiply(K4, m), K3));
    let even = add(multiply(K2, m), K1);
    let p = add(multiply(add(multiply(odd, t), even), m), ONE);
    let h = multiply(p, p);
    let q = multiply(h, h);
    return multiply(q, q);
}

// A workgroup for each tile, an invocation for each pixel. Each walks the masks of the tile by itself: beside the
// arithmetic that costs nothing, and it is in the order of the splats, as (9-6) wants.
@compute @workgroup_size(TILE, TILE)
fn sum_exactly(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) place_in_tile: vec3<u32>) {
    let place = TILE * tile.xy + place_in_tile.xy;
    if (any(place >= view.extent)) {
        return;
    }
    let x = centre_of(view.origin.x + place.x);
    let y = centre_of(view.origin.y + place.y);
    let at = 3u * (place.y * view.extent.x + place.x);
    var color: array<u32, 3>;
    for (var k = 0u; k < 3u; k++) {
        color[k] = exact_sums[at + k];
    }
    let words = word_count();
    for (var word = 0u; word < words; word++) {
        var mask = masks[tile.x * words + word] & masks[(tile_count().x + tile.y) * words + word];
        while (mask != 0u) {
            let splat = exact_splats[32u * word + firstTrailingBit(mask)];
            mask &= mask - 1u;
            let m = squared_distance(splat, x, y);
            if (m <= SUPPORT_SQUARED) {    // m has no sign, and the bits of infinity and NaN are larger
                let g = weight(m);
                for (var k = 0u; k < 3u; k++) {
                    color[k] = add(color[k], multiply(g, splat.color[k]));    // (9-6)
                }
            }
        }
    }
    for (var k = 0u; k < 3u; k++) {
        exact_sums[at + k] = color[k];
    }
}

// (9-7): an invocation for each word of the frame.
@compute @workgroup_size(256)
fn quantize_exactly(@builtin(global_invocation_id) id: vec3<u32>) {
    let sample_bits = select(16u, 8u, view.peak == 255.0);    // range: 8 or 16
    let samples_of_word = 32u / sample_bits;                  // range: 4 or 2, an integer
    let first = samples_of_word * id.x;
    let sample_count = 3u * view.extent.x * view.extent.y;     // range: an integer
    if (first >= sample_count) {
        return;
    }
    var word = 0u;
    // range: below 4 or 2: sample_bits k is at most 24
    for (var k = 0u; k < min(samples_of_word, sample_count - first); k++) {
        word |= level(exact_sums[first + k]) << (sample_bits * k);
    }
    frame[id.x] = word;
}

// v of (9-7) times the peak, as an integer.
fn level(value: u32) -> u32 {
    if ((value & SIGN) != 0u || is_nan(value)) {
        return 0u;
    }
    let scaled = unpacked(multiply(min(value, ONE), from_integer(u32(view.peak))));    // significand 2^(exponent - 150)
    return nearest(shifted_right(scaled.significand, u32(148 - scaled.exponent)));
}

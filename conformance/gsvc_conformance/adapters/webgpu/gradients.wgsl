// The gradients of splats (spec.md, section 10.3), from dL/dC of every pixel.
//
//     pass       dispatch                 bindings     what
//     moments    splat_count              0 1 2 3      the moments S of (13-12), added to those of other bands of rows
//     finish     splat_count / 64         0 1 3 4      (10-7) to (10-9) of them
//
// A workgroup for each splat: its lanes share the pixels of its box and add up what they found as a tree. So nothing is
// added by atomics, whose order changes from run to run and which WGSL does not have for floats. A large splat takes
// longer than the others; a tree also rounds less than a long row of additions.

struct Band {
    columns: u32,
    first_row: u32,
    rows: u32,
    splat_count: u32,
}

struct Moments {
    of_color: vec3<f32>,    // sum of g e
    of_uu: vec3<f32>,       // sums of q u1 u1, q u1 u2, q u2 u2
    of_u: vec2<f32>,        // sums of q u1, q u2
}

@group(0) @binding(0) var<uniform> band: Band;
@group(0) @binding(1) var<storage, read> parameters: array<u32>;     // the bits of x, y, l11, l21, l22, R, G, B
@group(0) @binding(2) var<storage, read> residual: array<f32>;       // e = dL/dC of the band, (rows, columns, 3)
@group(0) @binding(3) var<storage, read_write> sums: array<Moments>;
@group(0) @binding(4) var<storage, read_write> gradients: array<f32>;

const SIDE = 8u;                  // lanes side by side, and rows of them
const LANES = 64u;
const LN_255_BITS = 0x40b15208u;  // ln 255 = 5.5412636 as binary32
const REACH = 3.3290684;          // rho' of (5-1)
const FAR = 0x1p+100f;            // far outside of every frame, and three times it is no overflow

struct Splat {
    centre: vec2<f32>,            // range: finite, or it has no reach
    r1: f32,                      // 1 / l11, or 0 above 2^126, as WGSL promises quotients only up to there
    l21: f32,                     // range: the same
    r2: f32,                      // 1 / l22
    color: vec3<f32>,
    reach: vec2<f32>,             // half width and height of the box; 0 for a degenerate splat. range: at most 2^103
}

fn read_splat(n: u32) -> Splat {
    var splat: Splat;
    let at = 8u * n;
    // range: of a splat that is drawn 2^-126 to the largest number, as it is looked at
    let l11 = bitcast<f32>(parameters[at + 2u]);
    // range: the same
    let l22 = bitcast<f32>(parameters[at + 4u]);
    splat.centre = bitcast<vec2<f32>>(vec2<u32>(parameters[at], parameters[at + 1u]));
    splat.l21 = bitcast<f32>(parameters[at + 3u]);
    splat.color = bitcast<vec3<f32>>(vec3<u32>(parameters[at + 5u], parameters[at + 6u], parameters[at + 7u]));
    // Told by bits, since a compiler may take all numbers for finite: l11 and l22 from 2^-126 to the largest number.
    let drawn = parameters[at + 2u] - 0x00800000u < 0x7f000000u && parameters[at + 4u] - 0x00800000u < 0x7f000000u
        && is_finite(parameters[at]) && is_finite(parameters[at + 1u]) && is_finite(parameters[at + 3u]);
    if (drawn) {
        splat.r1 = select(1.0 / l11, 0.0, l11 > 0x1p+126f);
        splat.r2 = select(1.0 / l22, 0.0, l22 > 0x1p+126f);
        splat.reach = REACH * vec2<f32>(min(l11, FAR), min(abs(splat.l21), FAR) + min(l22, FAR));
    }
    return splat;
}

fn is_finite(bits: u32) -> bool {
    return (bits & 0x7f800000u) != 0x7f800000u;
}

// ---- moments

var<workgroup> parts: array<Moments, LANES>;

@compute @workgroup_size(SIDE, SIDE)
fn moments(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>,
           @builtin(local_invocation_index) lane: u32) {
    let splat = read_splat(group.x);
    // range: finite as the centre is
    let near = clamp(splat.centre, vec2<f32>(-FAR), vec2<f32>(FAR)) - vec2<f32>(0.0, f32(band.first_row));
    let size = vec2<f32>(vec2<u32>(band.columns, band.rows));    // range: 1 to 65535
    let first = vec2<u32>(clamp(floor(near - splat.reach), vec2<f32>(0.0), size));    // clamped, then made an integer
    let end = vec2<u32>(clamp(ceil(near + splat.reach), vec2<f32>(0.0), size));

    var mine: Moments;
    if (all(splat.reach > vec2<f32>(0.0))) {
        for (var row = first.y + place.y; row < end.y; row += SIDE) {
            for (var column = first.x + place.x; column < end.x; column += SIDE) {
                let d = vec2<f32>(vec2<u32>(column, band.first_row + row)) + 0.5 - splat.centre;
                let u1 = d.x * splat.r1;    // (10-3)
                let u2 = (d.y - splat.l21 * u1) * splat.r2;
                let sigma = 0.5 * (u1 * u1 + u2 * u2);
                // sigma has no sign, so its bits compare as it does, and those of infinity and NaN are larger.
                if (bitcast<u32>(sigma) <= LN_255_BITS) {
                    let at = 3u * (row * band.columns + column);
                    let e = vec3<f32>(residual[at], residual[at + 1u], residual[at + 2u]);
                    let g = exp(-sigma);
                    let q = g * dot(e, splat.color);    // (10-6)
                    mine.of_color += g * e;
                    mine.of_u += q * vec2<f32>(u1, u2);
                    mine.of_uu += q * vec3<f32>(u1 * u1, u1 * u2, u2 * u2);
                }
            }
        }
    }

    parts[lane] = mine;
    workgroupBarrier();
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        if (lane < half) {
            parts[lane] = added(parts[lane], parts[lane + half]);
        }
        workgroupBarrier();
    }
    if (lane == 0u) {
        sums[group.x] = added(sums[group.x], parts[0]);
    }
}

fn added(a: Moments, b: Moments) -> Moments {
    return Moments(a.of_color + b.of_color, a.of_uu + b.of_uu, a.of_u + b.of_u);
}

// ---- finish: the factors of v1 = (u1 - l21 v2) / l11 and v2 = u2 / l22 (10-3), which all pixels share: (13-12).

@compute @workgroup_size(LANES)
fn finish(@builtin(global_invocation_id) id: vec3<u32>) {
    let n = id.x;
    if (n >= band.splat_count) {
        return;
    }
    let splat = read_splat(n);
    let sum = sums[n];
    // l21 / (l11 l22). Of three factors, two from both sides of 1 go first: so no step leaves the range of binary32
    // unless the result does. A splat far thinner than a pixel would get 0 times infinity.
    let apart = (splat.r1 <= 1.0) != (splat.r2 <= 1.0);
    let slope = select((splat.l21 * splat.r1) * splat.r2, (splat.r1 * splat.r2) * splat.l21, apart);
    let at = 8u * n;
    gradients[at] = sum.of_u.x * splat.r1 - slope * sum.of_u.y;
    gradients[at + 1u] = sum.of_u.y * splat.r2;                            // (10-7)
    gradients[at + 2u] = sum.of_uu.x * splat.r1 - slope * sum.of_uu.y;
    gradients[at + 3u] = sum.of_uu.y * splat.r2;
    gradients[at + 4u] = sum.of_uu.z * splat.r2;                           // (10-8)
    gradients[at + 5u] = sum.of_color.r;
    gradients[at + 6u] = sum.of_color.g;
    gradients[at + 7u] = sum.of_color.b;                                   // (10-9)
}

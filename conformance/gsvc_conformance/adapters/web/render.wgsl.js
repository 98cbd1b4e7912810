/* Tiled rendering of GSVC in WGSL: the sum of the splats of a frame (spec.md, section 9) and the frame made of it.

   The browser page and the Python adapter conformance/gsvc_conformance/adapters/webgpu/ share this text; Python takes what stands
   between the two backticks. So there is no backtick, backslash or dollar sign in it.

   Passes, in this order, all in bind group 0 (layout "auto" gives each pipeline the bindings that it uses):

     pass       dispatch                                          bindings
     prepare    ceil(splat_count / 64)                            0 1 2 3
     mark       ceil(words / 64), tiles_across + tiles_down       0 3 4
     sum        tiles_across, tiles_down                          0 2 4 5
     quantize   ceil(frame words / 256)                           0 5 6
     corners,   a triangle of 3 vertices, without buffers         (none)
     show       of a target of extent pixels                      0 7

     binding  usage    what                            bytes
     0        uniform  struct View                     40
     1        storage  parameters, f4 (N, 8)           32 splat_count
     2        storage  splats, as drawn                32 splat_count
     3        storage  spans, in tiles                 16 splat_count
     4        storage  masks                           4 words (tiles_across + tiles_down)
     5        storage  sums, f4 (rows, columns, 3)     12 extent.x extent.y
     6        storage  frame, u1 or u2 (rows, ...)     3 extent.x extent.y, twice that above 8 bits, whole words
     7        storage  sums again, only read

   with words = ceil(splat_count / 32) and tiles of 16 x 16 pixels: tiles_across = ceil(extent.x / 16), tiles_down
   likewise.

   sum adds to what is in sums. So clear them to zero, then run prepare, mark and sum for one slice of the splats after
   the other, in order: 65,536 of them need no more than 64 MiB of masks for any frame, and nearly always they are all.
   With no splats, only clear. quantize or show comes last. The result is the same in every run: there is no atomic. */

"use strict";
globalThis.GSVC ??= {};

GSVC.RENDER_WGSL = /* wgsl */ `
struct View {
    origin: vec2<u32>,    // column and row of the first pixel made here: a large frame is made in bands of rows
    extent: vec2<u32>,    // columns and rows made here
    scale: vec2<f32>,     // a and e of (9-8), and of (9-9) below 1: (1, 1) for the coded size. range: 2^-16 to 2^16
    shift: vec2<f32>,     // added to the scaled centres, in pixels: minus left and top of a zoomed view, else (0, 0)
    splat_count: u32,     // of this slice
    peak: f32,            // 2^bit_depth - 1. range: 255 to 65535
}

struct Splat {
    centre: vec2<f32>,
    r1: f32,              // 1 / l11
    l21: f32,
    color: vec3<f32>,
    r2: f32,              // 1 / l22
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> parameters: array<u32>;            // the bits of x, y, l11, l21, l22, R, G, B
@group(0) @binding(2) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(3) var<storage, read_write> spans: array<vec2<u32>>;     // tile columns of all splats, then rows
@group(0) @binding(4) var<storage, read_write> masks: array<u32>;           // a bit a splat, for a tile column or row
// range: finite; what an infinite sum or one that is no number becomes is left open (R-13-3)
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;
@group(0) @binding(6) var<storage, read_write> frame: array<u32>;
@group(0) @binding(7) var<storage, read> finished_sums: array<f32>;

const TILE = 16u;
const LANES = 64u;                // of a tile
const LN_255_BITS = 0x40b15208u;  // ln 255 = 5.5412636 as binary32
const REACH = 3.3290684;          // rho' of (5-1)
const FAR = 0x1p+100f;            // far outside of every frame, and three times it is no overflow

fn tile_count() -> vec2<u32> {
    return (view.extent + TILE - 1u) / TILE;
}

fn word_count() -> u32 {
    return (view.splat_count + 31u) / 32u;
}

// ---- prepare: once for each splat, what all pixels need of it, and the tiles of its box.

// WGSL lets a compiler take all numbers for finite and flush subnormal ones. So what is not finite or not normal is
// told by its bits, as integers.

fn is_finite(bits: u32) -> bool {
    return (bits & 0x7f800000u) != 0x7f800000u;
}

// Finite and at least 2^-126: 00800000 to 7F7FFFFF.
fn is_factor(bits: u32) -> bool {
    return bits - 0x00800000u < 0x7f000000u;
}

// WGSL promises quotients only for divisors up to 2^126. The reciprocal of a larger one is below 2^-126, so 0 is near
// enough: the error model (13-3) has an eta for it.
// range: l is 2^-126 or more
fn reciprocal(l: f32) -> f32 {
    if (l > 0x1p+126f) {
        return 0.0;
    }
    return 1.0 / l;
}

// First and end tile of a box (5-1) in one direction; equal if it is empty. Sides are clamped before they become
// integers.
// range: all are finite, reach is at most 2^103
fn span(centre: f32, reach: f32, origin: u32, extent: u32) -> vec2<u32> {
    let near = clamp(centre, -FAR, FAR);    // range: finite
    let first = clamp(floor(near - reach) - f32(origin), 0.0, f32(extent));    // range: 0 to 65535
    let end = clamp(ceil(near + reach) - f32(origin), 0.0, f32(extent));       // range: 0 to 65535
    if (first >= end) {
        return vec2<u32>(0u, 0u);
    }
    return vec2<u32>(u32(first) / TILE, (u32(end) + TILE - 1u) / TILE);
}

// The root of p p + q q, of which none may leave the range.
// range: the greater one is 2^-126 or more, both are finite
fn norm(p: f32, q: f32) -> f32 {
    let large = max(abs(p), abs(q));    // range: as said
    let ratio = min(abs(p), abs(q)) / large;
    return large * sqrt(1.0 + ratio * ratio);
}

// l11, l21, l22 of (9-9), and the factor of the colour, of those of (9-8).
fn filtered(l11: f32, l21: f32, l22: f32) -> vec4<f32> {
    let widths = sqrt(max((1.0 - view.scale) * (1.0 + view.scale), vec2<f32>()) / 12.0);    // the roots of v
    let m11 = norm(l11, widths.x);                                          // range: 2^-126 or more
    let m22 = norm(norm(l22, widths.y), l21 * (widths.x / m11));            // range: 2^-126 or more
    return vec4<f32>(m11, l21 * (l11 / m11), m22, l11 / m11 * (l22 / m22));
}

@compute @workgroup_size(64)
fn prepare(@builtin(global_invocation_id) id: vec3<u32>) {
    let n = id.x;
    if (n >= view.splat_count) {
        return;
    }
    var bits: array<u32, 8>;
    var drawn = true;
    for (var k = 0u; k < 8u; k++) {
        bits[k] = parameters[8u * n + k];
        drawn = drawn && (k >= 5u || is_finite(bits[k]));
    }
    drawn = drawn && is_factor(bits[2]) && is_factor(bits[4]);
    let centre = bitcast<vec2<f32>>(vec2<u32>(bits[0], bits[1])) * view.scale + view.shift;    // (9-8)
    var l11 = bitcast<f32>(bits[2]) * view.scale.x;    // range: finite where the splat is drawn
    var l21 = bitcast<f32>(bits[3]) * view.scale.y;    // range: the same for scales up to 1
    var l22 = bitcast<f32>(bits[4]) * view.scale.y;    // range: the same
    var color = bitcast<vec3<f32>>(vec3<u32>(bits[5], bits[6], bits[7]));
    if (drawn && any(view.scale < vec2<f32>(1.0))) {
        let smoothed = filtered(l11, l21, l22);
        l11 = smoothed.x;
        l21 = smoothed.y;
        l22 = smoothed.z;
        color *= smoothed.w;
    }
    if (!drawn || !is_factor(bitcast<u32>(l11)) || !is_factor(bitcast<u32>(l22))) {    // degenerate: covers nothing
        spans[n] = vec2<u32>(0u, 0u);
        spans[view.splat_count + n] = vec2<u32>(0u, 0u);
        return;
    }
    let reach_x = REACH * min(l11, FAR);
    let reach_y = REACH * (min(abs(l21), FAR) + min(l22, FAR));
    spans[n] = span(centre.x, reach_x, view.origin.x, view.extent.x);
    spans[view.splat_count + n] = span(centre.y, reach_y, view.origin.y, view.extent.y);
    splats[n] = Splat(centre, reciprocal(l11), l21, color, reciprocal(l22));
}

// ---- mark: which splats touch a column of tiles, and which a row of tiles, a bit each.
//
// A box touches a tile if it touches both its column and its row. So the list of a tile is the AND of two masks: it
// has the order of the splats, needs neither atomics nor sorting nor a limit, and its size is known before: 188 masks
// do for the 8160 tiles of 1920 x 1080 pixels. One invocation makes the 32 bits of one word.

@compute @workgroup_size(64)
fn mark(@builtin(global_invocation_id) id: vec3<u32>) {
    let word = id.x;
    if (word >= word_count()) {
        return;
    }
    let across = tile_count().x;
    let is_row = id.y >= across;
    let tile = select(id.y, id.y - across, is_row);
    let first_span = select(0u, view.splat_count, is_row);
    var mask = 0u;
    for (var n = 32u * word; n < min(32u * word + 32u, view.splat_count); n++) {
        let tiles = spans[first_span + n];
        if (tiles.x <= tile && tile < tiles.y) {
            mask |= 1u << (n & 31u);
        }
    }
    masks[id.y * word_count() + word] = mask;
}

// ---- sum: a workgroup for each tile; each of its lanes has four pixels of a column, one below the other.

var<workgroup> counts: array<u32, LANES>;
var<workgroup> batch: array<Splat, LANES>;

// exp(-sigma) of a splat at four pixels, (9-1); 0 where it does not cover one. Pixels of a column share u1.
fn weights(splat: Splat, column: f32, rows: vec4<f32>) -> vec4<f32> {
    let d_x = column - splat.centre.x;
    let d_y = rows - splat.centre.y;    // this comes first: j + 1/2 - (y + l21 u1) would lose digits (section 13.3)
    let u1 = d_x * splat.r1;
    let u2 = (d_y - splat.l21 * u1) * splat.r2;
    let sigma = 0.5 * (u1 * u1 + u2 * u2);
    // sigma has no sign, so its bits compare as it does, and those of infinity and NaN are larger: such pixels are not
    // covered, even if a compiler takes all numbers for finite and folds comparisons of floats away.
    let covered = bitcast<vec4<u32>>(sigma) <= vec4<u32>(LN_255_BITS);
    return select(vec4<f32>(0.0), exp(-sigma), covered);
}

@compute @workgroup_size(TILE, TILE / 4)
fn sum(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) lane_in_tile: vec3<u32>,
       @builtin(local_invocation_index) lane: u32) {
    let place = TILE * tile.xy + vec2<u32>(1u, 4u) * lane_in_tile.xy;    // of the first of the four pixels
    let column = f32(view.origin.x + place.x) + 0.5;
    let rows = vec4<f32>(view.origin.y + place.y + vec4<u32>(0u, 1u, 2u, 3u)) + 0.5;
    let words = word_count();
    var red = vec4<f32>(0.0);
    var green = vec4<f32>(0.0);
    var blue = vec4<f32>(0.0);

    for (var first_word = 0u; first_word < words; first_word += LANES) {
        // Each lane takes the bits of 32 splats ...
        let word = first_word + lane;
        var mask = 0u;
        if (word < words) {
            mask = masks[tile.x * words + word] & masks[(tile_count().x + tile.y) * words + word];
        }
        // ... and learns how many splats the lanes before it have, by a prefix sum.
        counts[lane] = countOneBits(mask);
        workgroupBarrier();
        for (var step = 1u; step < LANES; step *= 2u) {
            var before = 0u;
            if (lane >= step) {
                before = counts[lane - step];
            }
            workgroupBarrier();
            counts[lane] += before;
            workgroupBarrier();
        }
        var rank = counts[lane] - countOneBits(mask);    // of this lane's next splat among those of the tile
        let splats_of_tile = workgroupUniformLoad(&counts[LANES - 1u]);

        // Then batches: the lanes put their splats side by side, and every pixel takes all of them.
        for (var start = 0u; start < splats_of_tile; start += LANES) {
            while (mask != 0u && rank < start + LANES) {
                batch[rank - start] = splats[32u * word + firstTrailingBit(mask)];
                mask &= mask - 1u;
                rank++;
            }
            workgroupBarrier();
            for (var k = 0u; k < min(LANES, splats_of_tile - start); k++) {
                let splat = batch[k];
                let g = weights(splat, column, rows);
                red += g * splat.color.r;    // (9-2)
                green += g * splat.color.g;
                blue += g * splat.color.b;
            }
            workgroupBarrier();
        }
    }

    for (var k = 0u; k < 4u; k++) {
        if (place.x < view.extent.x && place.y + k < view.extent.y) {
            let at = 3u * ((place.y + k) * view.extent.x + place.x);
            sums[at] += red[k];
            sums[at + 1u] += green[k];
            sums[at + 2u] += blue[k];
        }
    }
}

// ---- quantize: the frame as bytes, or as 16-bit samples above 8 bits; an invocation for each word of it.

@compute @workgroup_size(256)
fn quantize(@builtin(global_invocation_id) id: vec3<u32>) {
    let sample_bits = select(16u, 8u, view.peak == 255.0);    // range: 8 or 16
    let samples_of_word = 32u / sample_bits;                  // range: 4 or 2, an integer
    let first = samples_of_word * id.x;                        // range: an integer
    let sample_count = 3u * view.extent.x * view.extent.y;     // range: an integer
    if (first >= sample_count) {
        return;
    }
    var word = 0u;
    // range: below 4 or 2: sample_bits k is at most 24
    for (var k = 0u; k < min(samples_of_word, sample_count - first); k++) {
        let level = round(clamp(sums[first + k], 0.0, 1.0) * view.peak);    // R-9.1-1: to even. range: of the peak
        word |= u32(level) << (sample_bits * k);
    }
    frame[id.x] = word;
}

// ---- corners, show: the same on a canvas.

@vertex
fn corners(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32(index & 1u), f32(index >> 1u));    // (0, 0), (1, 0), (0, 1)
    return vec4<f32>(4.0 * corner - 1.0, 0.0, 1.0);
}

@fragment
// range: position is inside of the target
fn show(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let place = vec2<u32>(position.xy);
    let at = 3u * (place.y * view.extent.x + place.x);
    // range: finite, as the sums above
    let value = vec3<f32>(finished_sums[at], finished_sums[at + 1u], finished_sums[at + 2u]);
    let levels = round(clamp(value, vec3<f32>(0.0), vec3<f32>(1.0)) * view.peak);
    return vec4<f32>(levels / view.peak, 1.0);
}
`;

// States of profile `main` (spec.md, sections 15.4 and 15.9 to 15.11), each splat or cell an invocation.
//
//     pass             dispatch       bindings              what
//     splat_classes    splats / 256   0 2 6                 (15-4) of states
//     code_classes     splats / 256   0 3 6                 (15-4) of colour codes
//     window_codes     splats / 256   0 2 3 4 5 6           codes of size, aspect or shear from bins and low bits
//     place_bits       splats / 256   0 2 4 6               how many bits x or y of a place in a cell has
//     main_intra       splats / 256   0 2 3 4 5 6           (15-10), (15-15)
//     new_splats       splats / 256   0 2 3 4 5 6 7 8       the same, after the splats that stay
//     difference_contexts   splats / 256   0 2 4 6 7 8      which differences have a sign, and contexts of the next ones
//     signed_codes     splats / 256   0 2 3 4 6             codes of classes of magnitudes, low bits and signs
//     differences      splats / 256   0 2 3 4 5 6           differences of classes, low bits and signs
//     field_contexts   cells / 256    0 2 6                 the contexts of the magnitudes in y
//     field_vectors    rows / 256     0 2 6                 the vectors of the field
//     motion_of_splats splats / 256   0 2 3 6               (15-12)
//     mode_contexts    splats / 256   0 2 3 4 5 6
//     main_inter       splats / 256   0 1 2 3 4 6           (15-13)
//     stay             splats / 256   0 1 2 3 4 5 6 7 8     the same for the splats of a list
//
// The texts of main_tables.wgsl and main_densities.wgsl stand in front. No product or sum leaves 32 bits: codes of colours
// are below 2^20 in magnitude, differences at most 2^12, D below 2^13, steps of positions below 2^17, motion below 2^22.

struct Frame {
    count: u32,              // splats; cells or rows of a field
    step: i32,               // D. range: at least 1
    width: i32,
    height: i32,
    columns: i32,            // of the field
    rows: i32,
    side: i32,               // of its cells, 0 without a field
    first: u32,              // the first density of a plane, or context of a component
    component: u32,          // which one of a splat's is written
    components: u32,         // of a splat
    last: u32,               // 1: this is the last component of its group
    bit: u32,                // of the group in the modes
    mark: u32,               // what the new splats of a frame have for p
}

const N_MOST = 268435456;    // 2^28

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> state: array<i32>;                 // (splats, 8)
@group(0) @binding(6) var<storage, read_write> result: array<i32>;

fn colors_at(i: u32) -> vec3<i32> {
    return vec3<i32>(state[8u * i + 5u], state[8u * i + 6u], state[8u * i + 7u]);
}

@compute @workgroup_size(256)
fn splat_classes(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        result[id.x] = class_of(colors_at(id.x), frame.step);
    }
}

// ---- I-frames and new splats

@group(0) @binding(2) var<storage, read> cells: array<i32>;                 // (splats, 2)
@group(0) @binding(3) var<storage, read> color_codes: array<i32>;           // (splats, 3)
@group(0) @binding(4) var<storage, read> shape_codes: array<i32>;           // (splats, 3)
@group(0) @binding(5) var<storage, read> places: array<i32>;                // (splats, 2)
@group(0) @binding(7) var<storage, read> survivors: array<u32>;             // how many, and which
@group(0) @binding(8) var<storage, read_write> past: array<u32>;            // p of each splat

// n of the codes.
fn coded_colors(i: u32) -> vec3<i32> {
    let k = vec3<i32>(color_codes[3u * i], color_codes[3u * i + 1u], color_codes[3u * i + 2u]);
    return clamp(k, vec3<i32>(-(N_MOST / frame.step)), vec3<i32>(N_MOST / frame.step)) * frame.step;
}

@compute @workgroup_size(256)
fn code_classes(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        result[id.x] = class_of(coded_colors(id.x), frame.step);
    }
}

// A and B of (15-10).
// range: j is 0 to 10
fn log_sizes(i: u32, j: i32) -> vec2<i32> {
    let size = shape_codes[3u * i];
    let aspect = shape_codes[3u * i + 1u];
    return clamp(vec2<i32>(size + aspect, size - aspect) * (1477 >> u32(j)), vec2<i32>(-3072), vec2<i32>(13311));
}

// g of x and y.
fn place_steps(sizes: vec2<i32>, j: i32) -> vec2<i32> {
    return clamp((sizes >> vec2<u32>(10u)) + 1 - j, vec2<i32>(-4), vec2<i32>(2));
}

fn intra(i: u32, at: u32) {
    let n = coded_colors(i);
    let j = class_of(n, frame.step);    // range: 0 to 10
    let sizes = log_sizes(i, j);
    let g = vec2<u32>(place_steps(sizes, j) + 8);    // range: 4 to 10
    let cell = vec2<i32>(cells[2u * i], cells[2u * i + 1u]);
    let place = vec2<i32>(places[2u * i], places[2u * i + 1u]);
    let position = 1024 * cell + (place << g) + (vec2<i32>(1) << (g - 1u));
    result[8u * at] = position.x;
    result[8u * at + 1u] = position.y;
    result[8u * at + 2u] = sizes.x;
    result[8u * at + 3u] = sizes.y;
    result[8u * at + 4u] = clamp(shape_codes[3u * i + 2u] * (2048 >> u32(j)), -32767, 32767);
    result[8u * at + 5u] = n.x;
    result[8u * at + 6u] = n.y;
    result[8u * at + 7u] = n.z;
}

@compute @workgroup_size(256)
fn main_intra(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        intra(id.x, id.x);
    }
}

@compute @workgroup_size(256)
fn new_splats(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        intra(id.x, survivors[0] + id.x);
        past[survivors[0] + id.x] = frame.mark;
    }
}

@group(0) @binding(2) var<storage, read> classes: array<u32>;               // of splats, or of their magnitudes
@group(0) @binding(2) var<storage, read> bins: array<u32>;
@group(0) @binding(3) var<storage, read> low: array<u32>;                   // the low bits after them
@group(0) @binding(4) var<storage, read> classes_of_splats: array<u32>;
@group(0) @binding(5) var<storage, read> densities: array<Density>;

@compute @workgroup_size(256)
fn window_codes(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        let density = densities[frame.first + classes_of_splats[id.x]];
        let bin = density.first + i32(bins[id.x]);
        result[frame.components * id.x + frame.component] = (bin << density.low_bits) + i32(low[id.x]);
    }
}

@compute @workgroup_size(256)
fn place_bits(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        let j = i32(classes[id.x]);
        let g = place_steps(log_sizes(id.x, j), j);
        result[id.x] = 2 - select(g.x, g.y, frame.component == 1u);
    }
}

// ---- Magnitudes and signs

@group(0) @binding(4) var<storage, read> modes: array<u32>;
@group(0) @binding(4) var<storage, read> signs: array<u32>;
@group(0) @binding(5) var<storage, read> present: array<u32>;                       // of differences: see below
@group(0) @binding(7) var<storage, read_write> before: array<u32>;                  // sums of classes of the group so far
@group(0) @binding(8) var<storage, read_write> contexts: array<u32>;                // of the next component

// range: q is below 40
fn magnitude_of(q: u32, low_bits: u32) -> u32 {
    return select(((2u + q % 2u) << (max(q, 4u) / 2u - 1u)) + low_bits, q, q < 4u);
}

// What is present of a difference: 0 if it is 0, 1 if it has a sign, 3 if its magnitude is 1 more than what is coded.
@compute @workgroup_size(256)
fn difference_contexts(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= frame.count || (modes[id.x] & frame.bit) == 0u) {
        return;
    }
    let q = classes[id.x];
    let sure = frame.last == 1u && before[id.x] == 0u;
    result[id.x] = select(i32(min(q, 1u)), 3, sure);
    before[id.x] += q;    // a class above 3 stands for more than 2
    contexts[id.x] = frame.first + min(before[id.x], 2u);
}

@compute @workgroup_size(256)
fn signed_codes(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        let magnitude = i32(magnitude_of(classes[id.x], low[id.x]));
        result[frame.components * id.x + frame.component] = select(magnitude, -magnitude, signs[id.x] == 1u);
    }
}

@compute @workgroup_size(256)
fn differences(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        let magnitude = i32(magnitude_of(classes[id.x], low[id.x]) + (present[id.x] >> 1u));
        result[8u * id.x + frame.component] = select(magnitude, -magnitude, signs[id.x] == 1u);
    }
}

// ---- The motion field

@group(0) @binding(2) var<storage, read> steps: array<i32>;                 // differences of vectors, (cells, 2)
@group(0) @binding(3) var<storage, read> vectors: array<i32>;               // (cells, 2)
@group(0) @binding(5) var<storage, read> field: array<i32>;                 // the same

@compute @workgroup_size(256)
fn field_contexts(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        let q = classes[id.x];
        result[id.x] = 1 + i32(q > 0u) + i32(q > 2u) + i32(q > 7u);
    }
}

fn reduced(v: i32) -> i32 {
    return ((v + 0x8000) & 0xffff) - 0x8000;
}

// An invocation for each row, which goes down the first column to find where the row begins.
@compute @workgroup_size(256)
fn field_vectors(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= u32(frame.rows)) {
        return;
    }
    let columns = u32(frame.columns);
    var sum = vec2<i32>(0);
    for (var row = 0u; row < id.x; row++) {
        sum += vec2<i32>(steps[2u * row * columns], steps[2u * row * columns + 1u]);
    }
    for (var cell = id.x * columns; cell < (id.x + 1u) * columns; cell++) {
        sum += vec2<i32>(steps[2u * cell], steps[2u * cell + 1u]);
        result[2u * cell] = reduced(sum.x);
        result[2u * cell + 1u] = reduced(sum.y);
    }
}

// The cell before a position, the one after it, and the 64ths of the way between their centres.
fn between(position: i32, cells_there: i32) -> vec3<i32> {
    let b = 31u - countLeadingZeros(256u * u32(frame.side));    // range: 8 to 23, since there is a field
    let u = clamp(position - 128 * frame.side, 0, (cells_there - 1) << b);
    let i = min(u >> b, max(cells_there - 2, 0));
    return vec3<i32>(i, min(i + 1, cells_there - 1), (u - (i << b)) >> (b - 6u));
}

fn vector(column: i32, row: i32) -> vec2<i32> {
    let at = 2u * u32(row * frame.columns + column);
    return vec2<i32>(vectors[at], vectors[at + 1u]);
}

@compute @workgroup_size(256)
fn motion_of_splats(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= frame.count) {
        return;
    }
    let x = between(state[8u * id.x], frame.columns);
    let y = between(state[8u * id.x + 1u], frame.rows);
    let upper = (64 - x.z) * vector(x.x, y.x) + x.z * vector(x.y, y.x);
    let lower = (64 - x.z) * vector(x.x, y.y) + x.z * vector(x.y, y.y);
    let moved = ((64 - y.z) * upper + y.z * lower + 32) >> vec2<u32>(6u);
    result[2u * id.x] = moved.x;
    result[2u * id.x + 1u] = moved.y;
}

// ---- P-frames

@group(0) @binding(3) var<storage, read> past_of_splats: array<u32>;
@group(0) @binding(4) var<storage, read> motion_before: array<i32>;         // (splats, 2)

fn field_at(column: i32, row: i32) -> vec2<i32> {
    let at = 2u * u32(row * frame.columns + column);
    return vec2<i32>(field[at], field[at + 1u]);
}

fn distance_of(own: vec2<i32>, column: i32, row: i32) -> i32 {
    if (column < 0 || column >= frame.columns || row < 0 || row >= frame.rows) {
        return 0;
    }
    let difference = abs(field_at(column, row) - own);
    return difference.x + difference.y;
}

@compute @workgroup_size(256)
fn mode_contexts(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= frame.count) {
        return;
    }
    let position = vec2<i32>(state[8u * id.x], state[8u * id.x + 1u]);
    let moved = position + vec2<i32>(motion_before[2u * id.x], motion_before[2u * id.x + 1u]);
    if (any(moved < vec2<i32>(0)) || any(moved >= 256 * vec2<i32>(frame.width, frame.height))) {
        result[id.x] = 9;
        return;
    }
    var unrest = 0;
    if (frame.side > 0) {
        let b = vec2<u32>(31u - countLeadingZeros(256u * u32(frame.side)));    // range: 8 to 23
        let cell = clamp(position >> b, vec2<i32>(0), vec2<i32>(frame.columns, frame.rows) - 1);
        let own = field_at(cell.x, cell.y);
        unrest = max(
            max(distance_of(own, cell.x - 1, cell.y), distance_of(own, cell.x + 1, cell.y)),
            max(distance_of(own, cell.x, cell.y - 1), distance_of(own, cell.x, cell.y + 1)),
        );
    }
    result[id.x] = 3 * i32(past_of_splats[id.x]) + i32(unrest > 2) + i32(unrest > 7);
}

@group(0) @binding(3) var<storage, read> motion: array<i32>;                // (splats, 2)
@group(0) @binding(4) var<storage, read> changes: array<i32>;               // differences q, (splats, 8)
@group(0) @binding(5) var<storage, read> staying: array<u32>;               // how many, and which
@group(0) @binding(7) var<storage, read> modes_before: array<u32>;

// The first term of S: |S| EXP2 is below 2^31. Shifted to the left it is above the range, but for 0.
fn sheared(s: i32, v: i32) -> i32 {
    let product = u32(abs(s)) * mantissa(v);
    let shift = 15 - (v >> 10u);    // range: 1 to 31 where it is used
    var magnitude = select(32767u, 0u, product == 0u);
    if (shift > 31) {
        magnitude = 0u;
    } else if (shift > 0) {
        magnitude = min(product >> u32(shift), 32767u);
    }
    return sign(s) * i32(magnitude);
}

fn inter(i: u32, at: u32) {
    let first = 8u * i;
    let n = colors_at(i);
    let j = class_of(n, frame.step);    // range: 0 to 10
    let a = state[first + 2u];
    let b = state[first + 3u];
    let s = state[first + 4u];
    let g_x = clamp(power(a + 512 - 1024 * j, 8), 1, 0x1ffff);
    let g_y = clamp(power(b + 512 - 1024 * j, 8), 1, 0x1ffff);
    // 32767 (2^17 - 1) is below 2^32.
    let g_s = sign(s) * i32(min((u32(abs(s)) * u32(g_y)) >> 10u, 0x1ffffu));
    let h = 1477 >> u32(j);
    let new_a = clamp(a + (changes[first + 2u] + changes[first + 3u]) * h, -3072, 13311);
    let new_b = clamp(b + (changes[first + 2u] - changes[first + 3u]) * h, -3072, 13311);
    let v = (new_a - a) - (new_b - b);
    let x = state[first] + motion[2u * i] + changes[first] * g_x;
    let y = state[first + 1u] + motion[2u * i + 1u] + changes[first] * g_s + changes[first + 1u] * g_y;
    let new_n = n + vec3<i32>(changes[first + 5u], changes[first + 6u], changes[first + 7u]) * frame.step;
    let clipped_n = clamp(new_n, vec3<i32>(-N_MOST), vec3<i32>(N_MOST));
    result[8u * at] = clamp(x, -0x1000000, 0x1000000);
    result[8u * at + 1u] = clamp(y, -0x1000000, 0x1000000);
    result[8u * at + 2u] = new_a;
    result[8u * at + 3u] = new_b;
    result[8u * at + 4u] = clamp(sheared(s, v) + changes[first + 4u] * (2048 >> u32(j)), -32767, 32767);
    result[8u * at + 5u] = clipped_n.x;
    result[8u * at + 6u] = clipped_n.y;
    result[8u * at + 7u] = clipped_n.z;
}

@compute @workgroup_size(256)
fn main_inter(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < frame.count) {
        inter(id.x, id.x);
    }
}

@compute @workgroup_size(256)
fn stay(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < staying[0]) {
        let i = staying[1u + id.x];
        inter(i, id.x);
        past[id.x] = min(modes_before[i], 1u);
    }
}

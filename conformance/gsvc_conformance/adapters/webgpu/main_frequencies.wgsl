// Cumulative frequencies of profile `main` (spec.md, sections 15.7, 15.8 and 15.11), and what they are made of.
//
//     pass                  dispatch         bindings    what
//     density_frequencies   bins / 256       0 1 2 3     (15-6) of any edges
//     half_frequencies      bins / 256       0 1 3 4     (15-8), (15-9)
//     window_frequencies    bins / 256       0 1 3 4     (15-7)
//     plane_densities       1                0 1 4       the densities of a frame's planes
//     model_frequencies     contexts / 256   0 2 3       (15-14)
//     adapt_model           contexts / 256   0 2 3 5     (15-11)
//
// The texts of main_tables.wgsl and main_densities.wgsl stand in front.

struct Numbers {
    count: u32,            // bins, splats or contexts
    symbols: u32,          // of a context; the step h of a window
    centre: i32,
    family: u32,
    scale_code: i32,
    unit_bits: i32,
    first_half: u32,
    second_half: u32,
    halving_code: u32,
}

struct Planes {
    planes: array<vec4<i32>, 6>,    // density_family, scale_code, centre and slope; both without what was added
}

@group(0) @binding(0) var<uniform> numbers: Numbers;
@group(0) @binding(0) var<uniform> planes: Planes;
@group(0) @binding(2) var<storage, read> edges: array<i32>;
@group(0) @binding(2) var<storage, read> counts: array<u32>;               // (contexts, symbols)
@group(0) @binding(3) var<storage, read_write> result: array<u32>;
@group(0) @binding(4) var<storage, read_write> densities: array<Density>;
@group(0) @binding(5) var<storage, read> seen: array<u32>;

@compute @workgroup_size(256)
fn density_frequencies(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if (i > numbers.count) {
        return;
    }
    if (i == 0u || i == numbers.count) {
        result[i] = select(TOTAL, 0u, i == 0u);
        return;
    }
    let distance = edges[i - 1u] - 2 * numbers.centre;
    let v = reached(distance, numbers.family, numbers.scale_code, numbers.unit_bits);
    result[i] = i + (((TOTAL - numbers.count) * v) >> 16u);
}

// `result` has room for n + 2 numbers; those after C[bins] stay 0.
@compute @workgroup_size(256)
fn half_frequencies(@builtin(global_invocation_id) id: vec3<u32>) {
    let density = half_density(numbers.count, numbers.first_half, numbers.second_half, numbers.halving_code);
    if (id.x <= density.bins) {
        result[id.x] = before_bin(density, id.x);
    }
    if (id.x == 0u) {
        densities[0] = density;
    }
}

@compute @workgroup_size(256)
fn window_frequencies(@builtin(global_invocation_id) id: vec3<u32>) {
    let density = window(numbers.family, numbers.scale_code, numbers.centre, i32(numbers.symbols));
    if (id.x <= density.bins) {
        result[id.x] = before_bin(density, id.x);
    }
    if (id.x == 0u) {
        densities[0] = density;
    }
}

@compute @workgroup_size(240)
fn plane_densities(@builtin(local_invocation_index) at: u32) {
    let plane = at / DENSITIES_OF_PLANE;
    let number = i32(at % DENSITIES_OF_PLANE);
    let told = planes.planes[plane];
    if (plane < 3u) {
        let centre = told.z + ((told.w * number) >> 2u);    // luma has no slope
        densities[at] = Density(u32(told.x), told.y, 2, centre, 0, 0u, 16, MAGNITUDE_CLASSES, 0u);
    } else {
        // range: 0 to 10
        let j = min(number, 10);
        let h = select(1477 >> u32(j), 2048 >> u32(j), plane == 5u);
        densities[at] = window(u32(told.x), told.y, 64 * told.z + 16 * told.w * j, h);
    }
}

// (15-7): 8 scales are below 2^15, centres below 2^17.
fn window(family: u32, scale_code: i32, centre: i32, h: i32) -> Density {
    let scale = power(256 * scale_code, 4);
    // range: at most 7, since 16 scales are below 2^16 and h is at least 1
    var low_bits = 0u;
    while (16 * scale > 512 * (h << low_bits)) {
        low_bits++;
    }
    let width = h << low_bits;
    let first = floor_quotient(centre - 8 * scale, width);
    let last = -floor_quotient(-centre - 8 * scale, width);
    return Density(family, scale_code, 4, centre, first, low_bits, h, u32(last - first + 1), low_bits);
}

// An invocation for each context. c' is below 2^17, so (2^14 - K) c' is below 2^31.
@compute @workgroup_size(256)
fn model_frequencies(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= numbers.count) {
        return;
    }
    let first = id.x * numbers.symbols;
    var sum = 0u;
    for (var s = 0u; s < numbers.symbols; s++) {
        sum += counts[first + s];
    }
    // range: at most 15
    let shift = u32(max(15 - i32(countLeadingZeros(sum)), 0));
    // range: above 0 behind its loop: a context has counts, and shift leaves 17 bits of their sum
    var kept = 0u;
    for (var s = 0u; s < numbers.symbols; s++) {
        kept += counts[first + s] >> shift;
    }
    var missing = TOTAL;
    var most = 0u;         // the greatest frequency, and the first symbol that has it
    var most_at = 0u;
    for (var s = 0u; s < numbers.symbols; s++) {
        let frequency = 1u + ((TOTAL - numbers.symbols) * (counts[first + s] >> shift)) / kept;
        missing -= frequency;
        if (frequency > most) {
            most = frequency;
            most_at = s;
        }
    }
    let cumulative = id.x * (numbers.symbols + 1u);
    var before = 0u;
    for (var s = 0u; s < numbers.symbols; s++) {
        result[cumulative + s] = before;
        before += 1u + ((TOTAL - numbers.symbols) * (counts[first + s] >> shift)) / kept;
        before += select(0u, missing, s == most_at);
    }
    result[cumulative + numbers.symbols] = before;
}

// An invocation for each context. ⌊7 c / 8⌋ is c - ⌈c / 8⌉, which needs no more bits than c.
@compute @workgroup_size(256)
fn adapt_model(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= numbers.count) {
        return;
    }
    let first = id.x * numbers.symbols;
    var used = false;
    for (var s = 0u; s < numbers.symbols; s++) {
        used = used || seen[first + s] > 0u;
    }
    for (var s = 0u; s < numbers.symbols; s++) {
        let c = counts[first + s];
        let adapted = c - (c >> 3u) - u32((c & 7u) != 0u) + 64u * seen[first + s];
        result[first + s] = select(c, adapted, used);
    }
}

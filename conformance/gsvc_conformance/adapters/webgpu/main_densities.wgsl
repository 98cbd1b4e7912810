// Densities of profile `main` (spec.md, sections 15.7 and 15.8): cumulative frequencies, one by one, without tables.
//
// The text of main_tables.wgsl stands in front of it, and it in front of the shaders that need it.

// Bins 0 to bins - 1, with doubled inner edges (2 ((first + i) << edge_shift) - 1) edge_unit: those of magnitudes and
// halves have another unit, those of a window a first bin and a shift.
struct Density {
    family: u32,            // density_family, or BETA_BINOMIAL
    scale_code: i32,
    unit_bits: i32,         // w
    centre: i32,            // m; α where the family is BETA_BINOMIAL
    first: i32,
    edge_shift: u32,
    edge_unit: i32,
    bins: u32,
    low_bits: u32,          // raw ones behind the bins; those of magnitudes depend on the bin
}

const LOGISTIC = 0u;
const BETA_BINOMIAL = 2u;
const PLANES = 6u;                  // luma, chroma1, chroma2, size, aspect, shear
const DENSITIES_OF_PLANE = 40u;     // one for each class of magnitudes of k0, or for each class of splats
const MAGNITUDE_CLASSES = 40u;

// v of (15-6) for e - 2 m = distance. Distances are below 2^18, also for the inputs that density_frequencies may have,
// and EXP2 below 2^16. The shift is at least 4: the four low bits of EXP2 go first, and rounding down twice is rounding
// down once. What is left are products below 2^30 and below 2^22.
fn reached(distance: i32, family: u32, scale_code: i32, unit_bits: i32) -> u32 {
    let scale = i32(mantissa(-256 * scale_code));
    let shift = u32(4 + ((scale_code + 3) >> 2u) + unit_bits);
    let product = distance * (scale >> 4u) + ((distance * (scale & 15)) >> 4u);    // 2^-4 of it
    let u = u32(clamp(0x8000 + (product >> (shift - 4u)), 0, 0xffff));
    let place = 1024u + 257u * family + (u >> 8u);
    return tables[place] + (((tables[place + 1u] - tables[place]) * (u & 0xffu)) >> 8u);
}

// C[i] of a density of bins.
fn before_bin(density: Density, i: u32) -> u32 {
    if (i == 0u || i == density.bins) {
        return select(TOTAL, 0u, i == 0u);
    }
    let edge = (2 * ((density.first + i32(i)) << density.edge_shift) - 1) * density.edge_unit;
    let v = reached(edge - 2 * density.centre, density.family, density.scale_code, density.unit_bits);
    return i + (((TOTAL - density.bins) * v) >> 16u);
}

// (15-8): the weights for n splats, and behind them their sum, which is at most 1315760602.
fn weights_of(n: u32, alpha: u32) -> array<u32, 17> {
    var weights: array<u32, 17>;
    weights[0] = 0x10000u;
    for (var i = 0u; i < n / 2u; i++) {
        // ⌊w a / b⌋ with w = q b + r is q a + ⌊r a / b⌋: a is at most 1500, b at most 912, and the result below 2^28.
        let a = (n - i) * (i + alpha);
        let b = (i + 1u) * (n - i - 1u + alpha);
        weights[i + 1u] = (weights[i] / b) * a + ((weights[i] % b) * a) / b;
    }
    var sum = 0u;
    for (var i = 0u; i <= n; i++) {
        weights[i] = weights[min(i, n - i)];
        sum += weights[i];
    }
    weights[16] = sum;
    return weights;
}

// ⌊part · factor / whole⌋ for part <= whole and a factor below 2^14, bit by bit of the factor: what is doubled is below
// the whole, and 3 · 1315760602 < 2^32.
fn share(part: u32, factor: u32, whole: u32) -> u32 {
    var quotient = 0u;
    var rest = 0u;
    for (var bit = 14u; bit > 0u; bit--) {
        rest = 2u * rest + part * ((factor >> (bit - 1u)) & 1u);
        quotient = 2u * quotient + rest / whole;
        rest %= whole;
    }
    return quotient;
}

// C[i] of the number of n splats in the first half.
fn before_count(given: array<u32, 17>, n: u32, i: u32) -> u32 {
    var weights = given;    // what is indexed by a variable has to be one
    var sum = 0u;
    for (var k = 0u; k < i; k++) {
        sum += weights[k];
    }
    return select(TOTAL, i + share(sum, TOTAL - n - 1u, weights[16]), i <= n);
}

// The density of how many of n splats are in the first half, p and q being the cells of both.
fn half_density(n: u32, p: u32, q: u32, alpha: u32) -> Density {
    if (p == q && n <= 15u) {
        return Density(BETA_BINOMIAL, 0, 0, i32(alpha), 0, 0u, 0, n + 1u, 0u);
    }
    let low_bits = u32(max(23 - i32(countLeadingZeros(n)), 0));
    let m = n >> low_bits;                                    // below 2^9
    let b = 256u * p / (p + q);
    // (15-9): m b (256 - b) is below 2^23, the other factor below 2^20. ⌊· / 2^16⌋ from the twelve low bits of the
    // first one and the rest: both products are below 2^32, and their sum, too.
    let first = m * b * (256u - b);
    let second = (2u * alpha + m) * 1245u;
    let v = (((first >> 12u) * second + (((first & 0xfffu) * second) >> 12u)) >> 4u) / (2u * alpha + 1u);
    let e = 31u - countLeadingZeros(max(v, 1u));
    let scale_code = 2u * e + select(0u, (v >> (max(e, 1u) - 1u)) & 1u, e > 0u);
    return Density(LOGISTIC, i32(scale_code), 0, i32(m * b / 4u), 0, 0u, 64, m + 1u, low_bits);
}

struct Symbol {
    value: u32,
    start: u32,         // c(s)
    frequency: u32,     // f(s)
}

// The bin of a slot: C[s] <= slot < C[s + 1].
fn symbol_of_density(density: Density, slot: u32) -> Symbol {
    if (density.family == BETA_BINOMIAL) {
        return symbol_of_half(density.bins - 1u, u32(density.centre), slot);
    }
    var low = 0u;
    var high = density.bins;
    var start = 0u;
    var end = TOTAL;
    while (high - low > 1u) {
        let middle = (low + high) / 2u;
        let reached_there = before_bin(density, middle);
        if (reached_there <= slot) {
            low = middle;
            start = reached_there;
        } else {
            high = middle;
            end = reached_there;
        }
    }
    return Symbol(low, start, end - start);
}

fn symbol_of_half(n: u32, alpha: u32, slot: u32) -> Symbol {
    let weights = weights_of(n, alpha);
    var s = 0u;
    var start = 0u;
    var end = before_count(weights, n, 1u);
    while (end <= slot) {
        s++;
        start = end;
        end = before_count(weights, n, s + 1u);
    }
    return Symbol(s, start, end - start);
}

// Densities of profile `main` (spec.md, sections 15.7 and 15.8): cumulative frequencies, one by one, without tables.
//
// The text of main_tables.wgsl stands in front of it, and it in front of the shaders that need it.

// Bins 0 to bins - 1, with doubled inner edges (2 ((first + i) << edge_shift) - 1) edge_unit: those of magnitudes and
// halves have another unit, those of a window a first bin and a shift.
struct Density {
    family: u32,            // density_family, or BETA_BINOMIAL
    scale_code: i32,
    unit_bits: i32,         // w
    centre: i32,            // m; where the frequencies stand in `tables` if the family is BETA_BINOMIAL
    first: i32,
    edge_shift: u32,        // range: the low bits of a window, or 0
    edge_unit: i32,
    bins: u32,
    low_bits: u32,          // raw ones after the bins; those of magnitudes depend on the bin. range: at most 23
}

const LOGISTIC = 0u;
const BETA_BINOMIAL = 2u;
const HALVES = 1538u;               // where the tables of (15-8) begin, after those of section 15.3
const HALF_TABLE = 17u;             // numbers of each
const PLANES = 6u;                  // luma, chroma1, chroma2, size, aspect, shear
const DENSITIES_OF_PLANE = 40u;     // one for each class of magnitudes of k0, or for each class of splats
const MAGNITUDE_CLASSES = 40u;

// v of (15-6) for e - 2 m = distance, at most 2^16 in magnitude.
fn reached(distance: i32, family: u32, scale_code: i32, unit_bits: i32) -> u32 {
    // range: scale codes are below 64, units have at most 4 bits
    let shift = u32(2 + ((scale_code + 3) >> 2u) + unit_bits);
    let product = distance * i32(mantissa(-256 * scale_code) >> 2u);
    let u = u32(clamp(0x8000 + (product >> shift), 0, 0xffff));
    let place = 1024u + 257u * family + (u >> 8u);
    return tables[place] + (((tables[place + 1u] - tables[place]) * (u & 0xffu)) >> 8u);
}

// C[i] of a density of bins.
fn before_bin(density: Density, i: u32) -> u32 {
    if (i == 0u || i == density.bins) {
        return select(TOTAL, 0u, i == 0u);
    }
    if (density.family == BETA_BINOMIAL) {
        return tables[u32(density.centre) + i];
    }
    let edge = (2 * ((density.first + i32(i)) << density.edge_shift) - 1) * density.edge_unit;
    let v = reached(edge - 2 * density.centre, density.family, density.scale_code, density.unit_bits);
    return i + (((TOTAL - density.bins) * v) >> 16u);
}

fn alpha_of(halving_code: u32) -> u32 {
    var alphas = array<u32, 8>(1u, 2u, 3u, 4u, 6u, 10u, 20u, 100u);
    return alphas[halving_code];
}

// Where (15-8) stands for n splats and an α of a number.
fn half_table(n: u32, halving_code: u32) -> u32 {
    return HALVES + (15u * halving_code + n - 1u) * HALF_TABLE;
}

// The density of how many of n splats are in the first half, p and q being the cells of both.
// range: p and q are at least 1
fn half_density(n: u32, p: u32, q: u32, halving_code: u32) -> Density {
    if (p == q && n <= 15u) {
        return Density(BETA_BINOMIAL, 0, 0, i32(half_table(n, halving_code)), 0, 0u, 0, n + 1u, 0u);
    }
    // range: at most 23
    let low_bits = u32(max(23 - i32(countLeadingZeros(n)), 0));
    let m = n >> low_bits;                                    // below 2^9
    let b = 256u * p / (p + q);
    let alpha = alpha_of(halving_code);                       // range: 1 to 100
    let t = (2u * alpha + m) * 1245u / (2u * alpha + 1u);
    let v = (((m * b * (256u - b)) >> 9u) * t) >> 7u;         // (15-9)
    let e = 31u - countLeadingZeros(max(v, 1u));              // range: at most 31
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

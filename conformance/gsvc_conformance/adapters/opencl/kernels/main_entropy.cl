/* Profile main (section 15): tables, densities, models, and the passes of a frame, whose lanes are a work-group. The host
   is adapters/main_frames.py. Integers only; products that need them have 64 bits. */

typedef struct {
    int n[24];                              /* what a kernel is told, in the order of main_frames.py */
} Numbers;

/* Bins 0 to bins - 1, with doubled inner edges (2 ((first + i) << edge_shift) - 1) edge_unit. */
typedef struct {
    uint family;                            /* density_family, or BETA_BINOMIAL */
    int scale_code, unit_bits;
    int centre;                             /* where the frequencies stand in the tables if it is BETA_BINOMIAL */
    int first;
    uint edge_shift;
    int edge_unit;
    uint bins;
    uint low_bits;                          /* raw ones behind the bins; those of magnitudes depend on the bin */
} Density;

typedef struct {
    uint value, start, frequency;           /* s, c(s), f(s) */
} Symbol;

#define MAIN_TOTAL 0x4000u                  /* 2^14 */
#define MAIN_LANES 64                       /* work-items of the groups that decode, encode and make lists */
#define MAIN_TAKEN 64                       /* where a run has the number of words that were taken, behind its states */
#define LOWEST_STATE 0x10000u
#define FAMILIES 1024                       /* where LOGISTIC and LAPLACE begin in the tables, behind EXP2 */
#define HALVES 1538                         /* and the tables of (15-8), 17 numbers each */
#define BETA_BINOMIAL 2u

constant uint ALPHAS[8] = {1, 2, 3, 4, 6, 10, 20, 100};

int main_exp2(global const uint *tables, int v, int k)              /* (15-2) */
{
    int shift = (v >> 10) - 15 + k;
    uint mantissa = tables[v & 1023];
    return shift >= 0 ? mantissa << shift : mantissa >> min(-shift, 31);
}

/* v of (15-6) for e - 2 m = distance. */
uint reached(global const uint *tables, int distance, uint family, int scale_code, int unit_bits)
{
    int shift = 15 + (scale_code + 3) / 4 - 11 + unit_bits;
    long product = (long)distance * tables[-256 * scale_code & 1023];
    uint u = (uint)clamp(32768 + (product >> shift), (long)0, (long)65535);
    global const uint *T = tables + FAMILIES + 257 * family + (u >> 8);
    return T[0] + ((T[1] - T[0]) * (u & 255) >> 8);
}

uint before_bin(global const uint *tables, Density d, uint i)       /* C[i] */
{
    if (i == 0 || i == d.bins)
        return i == 0 ? 0 : MAIN_TOTAL;
    if (d.family == BETA_BINOMIAL)
        return tables[d.centre + i];
    int edge = (2 * ((d.first + (int)i) << d.edge_shift) - 1) * d.edge_unit;
    return i + ((MAIN_TOTAL - d.bins) * reached(tables, edge - 2 * d.centre, d.family, d.scale_code, d.unit_bits) >> 16);
}

/* How many of n splats are in the first half, p and q being the cells of both (15.8). */
Density half_density(uint n, uint p, uint q, uint halving_code)
{
    Density d = {BETA_BINOMIAL, 0, 0, HALVES + 17 * (15 * halving_code + n - 1), 0, 0, 0, n + 1, 0};
    if (p == q && n <= 15)
        return d;
    uint r = max(23 - (int)clz(n), 0), m = n >> r, b = 256 * p / (p + q), alpha = ALPHAS[halving_code];
    ulong v = (ulong)(m * b * (256 - b)) * ((2 * alpha + m) * 1245) / ((2 * alpha + 1) << 16);      /* (15-9) */
    uint e = 31 - clz((uint)max(v, (ulong)1));
    Density wide = {0, 2 * e + (e > 0 ? (uint)(v >> (e - 1)) & 1 : 0), 0, m * b / 4, 0, 0, 64, m + 1, r};
    return wide;
}

/* (15-8) for all n up to 15 and all alphas: a work-item for each number of each table. */
kernel void main_half_tables(global uint *tables)
{
    uint at = get_global_id(0), halving_code = at / 255, n = at / 17 % 15 + 1, i = at % 17, alpha;
    if (halving_code >= 8 || i > n + 1)
        return;
    alpha = ALPHAS[halving_code];
    ulong w[16], sum = 0, before = 0;
    w[0] = 65536;
    for (uint k = 0; k < n / 2; k++)
        w[k + 1] = w[k] * (n - k) * (k + alpha) / ((k + 1) * (n - k - 1 + alpha));
    for (uint k = 0; k <= n; k++) {
        w[k] = w[min(k, n - k)];
        before += k < i ? w[k] : 0;
        sum += w[k];
    }
    tables[HALVES + at] = i > n ? MAIN_TOTAL : i + (uint)((MAIN_TOTAL - n - 1) * before / sum);
}

kernel void main_density_frequencies(global const uint *tables, global const int *edges, global uint *result, Numbers told)
{
    uint i = get_global_id(0), bins = told.n[0];
    if (i <= bins) {
        uint v = i == 0 || i == bins ? 0 : reached(tables, edges[i - 1] - 2 * told.n[2], told.n[3], told.n[4], told.n[5]);
        result[i] = i == bins ? MAIN_TOTAL : i + ((MAIN_TOTAL - bins) * v >> 16);
    }
}

kernel void main_half_frequencies(global const uint *tables, global uint *result, global Density *density, Numbers told)
{
    uint i = get_global_id(0);
    Density d = half_density(told.n[0], told.n[6], told.n[7], told.n[8]);
    if (i <= d.bins)
        result[i] = before_bin(tables, d, i);
    if (i == 0)
        density[0] = d;
}

int floor_quotient(int a, int b)
{
    return a / b - (a % b < 0);
}

/* The densities of a frame's planes: 40 each, by the class of the magnitude of k0 or by that of the splat. */
kernel void main_plane_densities(global const uint *tables, global Density *densities, Numbers told)
{
    uint at = get_global_id(0), plane = at / 40;
    if (plane >= 6)
        return;
    int q = at % 40, j = min(q, 10), family = told.n[4 * plane], scale_code = told.n[4 * plane + 1];
    int centre = told.n[4 * plane + 2], slope = told.n[4 * plane + 3];
    if (plane < 3) {
        Density magnitudes = {family, scale_code, 2, centre + (slope * q >> 2), 0, 0, 16, 40, 0};
        densities[at] = magnitudes;
        return;
    }
    int h = plane == 5 ? 2048 >> j : 1477 >> j, scale = main_exp2(tables, 256 * scale_code, 4);
    uint r = 0;
    while (16 * scale > 512 * (h << r))
        r++;
    centre = 64 * centre + 16 * slope * j;
    int first = floor_quotient(centre - 8 * scale, h << r), last = -floor_quotient(-centre - 8 * scale, h << r);    /* (15-7) */
    Density window = {family, scale_code, 4, centre, first, r, h, last - first + 1, r};
    densities[at] = window;
}

/* (15-14), a work-item for each context. */
kernel void main_model_frequencies(global const uint *counts, global uint *result, Numbers told)
{
    uint context = get_global_id(0), symbols = told.n[1];
    if (context >= told.n[0])
        return;
    counts += context * symbols;
    result += context * (symbols + 1);
    ulong sum = 0, kept = 0;
    uint f[24], missing = MAIN_TOTAL, most = 0, shift = 0, before = 0;
    for (uint s = 0; s < symbols; s++)
        sum += counts[s];
    while (sum >> shift >= 131072)
        shift++;
    for (uint s = 0; s < symbols; s++)
        kept += counts[s] >> shift;
    for (uint s = 0; s < symbols; s++) {
        f[s] = 1 + (uint)((MAIN_TOTAL - symbols) * (ulong)(counts[s] >> shift) / kept);
        missing -= f[s];
        most = f[s] > f[most] ? s : most;
    }
    f[most] += missing;
    for (uint s = 0; s <= symbols; s++) {
        result[s] = before;
        before += s < symbols ? f[s] : 0;
    }
}

/* (15-11), a work-item for each context. */
kernel void main_adapt_model(global const uint *counts, global uint *result, global const uint *seen, Numbers told)
{
    uint context = get_global_id(0), symbols = told.n[1];
    bool used = false;
    if (context >= told.n[0])
        return;
    for (uint at = context * symbols; at < (context + 1) * symbols; at++)
        used = used || seen[at] > 0;
    for (uint at = context * symbols; at < (context + 1) * symbols; at++)
        result[at] = used ? (uint)(7 * (ulong)counts[at] >> 3) + 64 * seen[at] : counts[at];
}

/* ---- Lists: one work-group */

/* How many lanes before this one vote, and how many all do. All lanes have to come here. */
uint2 main_votes(bool vote, local uint *votes)
{
    uint lane = get_local_id(0);
    votes[lane] = vote;
    barrier(CLK_LOCAL_MEM_FENCE);
    uint before = 0, all = 0;
    for (uint other = 0; other < MAIN_LANES; other++) {
        before += other < lane ? votes[other] : 0;
        all += votes[other];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    return (uint2)(before, all);
}

/* The items with ((number ^ flipped) & mask) > threshold, and how many they are. */
kernel __attribute__((reqd_work_group_size(MAIN_LANES, 1, 1)))
void main_choose(global const uint *numbers, global uint *list, Numbers told)
{
    local uint votes[MAIN_LANES];
    uint count = told.n[0], taken = 0;
    for (uint first = 0; first < count; first += MAIN_LANES) {
        uint i = first + get_local_id(0);
        bool takes = i < count && ((numbers[told.n[1] + i * told.n[2]] ^ told.n[3]) & told.n[4]) > (uint)told.n[5];
        uint2 found = main_votes(takes, votes);
        if (takes)
            list[1 + taken + found.x] = i;
        taken += found.y;
    }
    if (get_local_id(0) == 0)
        list[0] = taken;
}

/* The sums of the numbers of the items before, for the items of a list. */
kernel __attribute__((reqd_work_group_size(MAIN_LANES, 1, 1)))
void main_starts(global const uint *numbers, global const uint *list, global uint *result, Numbers told)
{
    local uint own[MAIN_LANES];
    uint lane = get_local_id(0), sum = 0;
    for (uint first = 0; first < list[0]; first += MAIN_LANES) {
        uint i = first + lane, before = 0;
        own[lane] = i < list[0] ? numbers[told.n[1] + list[1 + i] * told.n[2]] : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint other = 0; other < MAIN_LANES; other++) {
            before += other < lane ? own[other] : 0;
        }
        if (i < list[0])
            result[i] = sum + before;
        for (uint other = 0; other < MAIN_LANES; other++)
            sum += own[other];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

/* The words of the items of a list, two for each work-item. */
kernel void main_words(global const uint *emitted, global const uint *list, global ushort *words)
{
    for (size_t i = 2 * get_global_id(0); i < 2 * get_global_id(0) + 2 && i < list[0]; i++)
        words[i] = (ushort)emitted[list[1 + i]];
}

/* ---- A run: one work-group, each lane a work-item */

/* (7-2): each lane goes through the symbols backwards and takes those of its own, so that none waits for another. */
kernel __attribute__((reqd_work_group_size(MAIN_LANES, 1, 1)))
void main_encode(global const uint *starts, global const uint *frequencies, global const uint *lanes, global uint *states,
                 global uint *emitted, Numbers told)
{
    uint lane = get_local_id(0);
    if (lane >= told.n[3])
        return;
    uint x = states[lane];
    for (uint k = 0; k < told.n[2]; k++) {
        uint i = told.n[1] - k, f = frequencies[i];
        if (lanes[i] != lane)
            continue;
        if (x >> 18 >= f) {                 /* x >= f << 18; once is enough */
            emitted[i] = 0x10000 | (x & 0xFFFF);
            x >>= 16;
        }
        x = ((x / f) << 14) + x % f + starts[i];
    }
    states[lane] = x;
}

/* What kernels of passes are told. */
#define LANE_COUNT told.n[0]
#define WORD_COUNT told.n[1]
#define FIRST_ROUND told.n[2]
#define ROUNDS told.n[3]
#define LISTED told.n[4]
#define ITEMS told.n[5]
#define CHOSEN_BY told.n[6]                 /* 0: the first distribution, 1: that of the item's choice, 2: of the item */
#define FIRST_CHOICE told.n[7]
#define SYMBOLS told.n[8]
#define MAGNITUDES told.n[9]                /* 1: symbols are classes of magnitudes */
#define KIND told.n[10]                     /* of raw bits: 0 the upper ones, 1 the lower 14, 2 signs */
#define PLACE(item) (told.n[11] + (item) * told.n[12])

uint bits_of_class(uint q)
{
    return q < 4 ? 0 : q / 2 - 1;
}

uint choice_of(uint item, global const uint *choices, Numbers told)
{
    return FIRST_CHOICE + (CHOSEN_BY == 0 ? 0 : CHOSEN_BY == 1 ? choices[item] : item);
}

Symbol symbol_of_context(global const uint *C, uint symbols, uint slot)
{
    uint low = 0, high = symbols;           /* C[low] <= slot < C[high] */
    while (high - low > 1) {
        uint middle = (low + high) / 2;
        if (C[middle] <= slot)
            low = middle;
        else
            high = middle;
    }
    Symbol found = {low, C[low], C[low + 1] - C[low]};
    return found;
}

Symbol symbol_of_density(global const uint *tables, Density d, uint slot)
{
    uint low = 0, high = d.bins;
    Symbol found = {0, 0, 0};
    while (high - low > 1) {
        uint middle = (low + high) / 2;
        if (before_bin(tables, d, middle) <= slot)
            low = middle;
        else
            high = middle;
    }
    found.value = low;
    found.start = before_bin(tables, d, low);
    found.frequency = before_bin(tables, d, low + 1) - found.start;
    return found;
}

/* A pass: the code finds the symbol of the item that this lane has in a round. Lanes that need a word find it behind those
   of the lanes before (15.6). A word that is missing is 0; the host sees how many were needed. */
#define PASS(find_symbol) \
    local uint votes[MAIN_LANES]; \
    uint lane = get_local_id(0), x = run[lane], taken = run[MAIN_TAKEN], count = LISTED ? list[0] : ITEMS; \
    uint rounds = (count + LANE_COUNT - 1) / LANE_COUNT; \
    rounds = min(rounds - min((uint)FIRST_ROUND, rounds), (uint)ROUNDS); \
    barrier(CLK_GLOBAL_MEM_FENCE); \
    for (uint round = 0; round < rounds; round++) { \
        uint i = (FIRST_ROUND + round) * LANE_COUNT + lane; \
        bool needs_word = false; \
        if (lane < LANE_COUNT && i < count) { \
            uint item = LISTED ? list[1 + i] : i, slot = x & 0x3FFF; \
            Symbol symbol; \
            find_symbol \
            x = symbol.frequency * (x >> 14) + slot - symbol.start;     /* (7-1) */ \
            needs_word = x < LOWEST_STATE; \
        } \
        uint2 found = main_votes(needs_word, votes); \
        if (needs_word) { \
            uint at = taken + found.x; \
            x = x << 16 | (at < WORD_COUNT ? words[at] : 0); \
        } \
        taken += found.y; \
    } \
    run[lane] = x; \
    if (lane == 0) \
        run[MAIN_TAKEN] = taken;

kernel __attribute__((reqd_work_group_size(MAIN_LANES, 1, 1)))
void main_read_modeled(global uint *run, global const ushort *words, global const uint *list, global const uint *choices,
                       global const uint *cumulative, global uint *values, global uint *seen, global uint *low_bits,
                       Numbers told)
{
    PASS(
        uint context = choice_of(item, choices, told);
        symbol = symbol_of_context(cumulative + context * (SYMBOLS + 1), SYMBOLS, slot);
        values[PLACE(item)] = symbol.value;
        low_bits[item] = MAGNITUDES ? bits_of_class(symbol.value) : 0;
        atomic_inc(seen + context * SYMBOLS + symbol.value);
    )
}

kernel __attribute__((reqd_work_group_size(MAIN_LANES, 1, 1)))
void main_read_densities(global const uint *tables, global uint *run, global const ushort *words, global const uint *list,
                         global const uint *choices, global const Density *densities, global uint *values,
                         global uint *low_bits, Numbers told)
{
    PASS(
        Density density = densities[choice_of(item, choices, told)];
        symbol = symbol_of_density(tables, density, slot);
        values[PLACE(item)] = symbol.value;
        low_bits[item] = MAGNITUDES ? bits_of_class(symbol.value) : density.low_bits;
    )
}

kernel __attribute__((reqd_work_group_size(MAIN_LANES, 1, 1)))
void main_read_bits(global uint *run, global const ushort *words, global const uint *list, global const uint *bit_counts,
                    global uint *values, Numbers told)
{
    PASS(
        uint bits = KIND == 2 ? 1 : KIND == 0 ? bit_counts[item] - 14 : min(bit_counts[item], 14u);
        symbol.value = slot >> (14 - bits);
        symbol.start = symbol.value << (14 - bits);
        symbol.frequency = MAIN_TOTAL >> bits;
        values[PLACE(item)] = values[PLACE(item)] << bits | symbol.value;
    )
}

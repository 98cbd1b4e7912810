/* Profile main (section 15): tables, densities, models, and the passes of a frame, whose lanes are a work-group. The host
   is adapters/main_frames.py. Integers of 32 bits only. */

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
    uint low_bits;                          /* raw ones after the bins; those of magnitudes depend on the bin */
} Density;

typedef struct {
    uint value, start, frequency;           /* s, c(s), f(s) */
} Symbol;

#define MAIN_TOTAL 0x4000u                  /* 2^14 */
#define MAIN_LANES 64                       /* work-items of the groups that make lists and offsets */
#define MAIN_GROUP 32                       /* lanes of a run that share words, and the work-items that decode them */
#define LOWEST_STATE 0x10000u
#define FAMILIES 1024                       /* where LOGISTIC and LAPLACE begin in the tables, after EXP2 */
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
    int product = distance * (int)(tables[-256 * scale_code & 1023] >> 2);
    uint u = (uint)clamp(32768 + (product >> (2 + (scale_code + 3) / 4 + unit_bits)), 0, 65535);
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
    uint t = (2 * alpha + m) * 1245 / (2 * alpha + 1), v = (m * b * (256 - b) >> 9) * t >> 7;       /* (15-9) */
    uint e = 31 - clz(max(v, 1u));
    Density wide = {0, 2 * e + (e > 0 ? v >> (e - 1) & 1 : 0), 0, m * b / 4, 0, 0, 64, m + 1, r};
    return wide;
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

/* floor(a / b) for b > 0, by unsigned quotients: one compiler gets % of negative numbers wrong. */
int floor_quotient(int a, int b)
{
    return a < 0 ? -(int)(((uint)-a + b - 1) / b) : (int)((uint)a / b);
}

Density window(global const uint *tables, uint family, int scale_code, int centre, int h)           /* (15-7) */
{
    int scale = main_exp2(tables, 256 * scale_code, 4);
    uint r = 0;
    while (16 * scale > 512 * (h << r))
        r++;
    int first = floor_quotient(centre - 8 * scale, h << r), last = -floor_quotient(-centre - 8 * scale, h << r);
    Density d = {family, scale_code, 4, centre, first, r, h, last - first + 1, r};
    return d;
}

kernel void main_window_frequencies(global const uint *tables, global uint *result, global Density *density, Numbers told)
{
    uint i = get_global_id(0);
    Density d = window(tables, told.n[3], told.n[4], told.n[2], told.n[1]);
    if (i <= d.bins)
        result[i] = before_bin(tables, d, i);
    if (i == 0)
        density[0] = d;
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
    int h = plane == 5 ? 2048 >> j : 1477 >> j;
    densities[at] = window(tables, family, scale_code, 64 * centre + 16 * slope * j, h);
}

/* (15-14), a work-item for each context. */
kernel void main_model_frequencies(global const uint *counts, global uint *result, Numbers told)
{
    uint context = get_global_id(0), symbols = told.n[1];
    if (context >= told.n[0])
        return;
    counts += context * symbols;
    result += context * (symbols + 1);
    uint sum = 0, kept = 0;
    uint f[24], missing = MAIN_TOTAL, most = 0, shift = 0, before = 0;
    for (uint s = 0; s < symbols; s++)
        sum += counts[s];
    while (sum >> shift >= 131072)
        shift++;
    for (uint s = 0; s < symbols; s++)
        kept += counts[s] >> shift;
    for (uint s = 0; s < symbols; s++) {
        f[s] = 1 + (MAIN_TOTAL - symbols) * (counts[s] >> shift) / kept;
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
        result[at] = used ? counts[at] - ((counts[at] + 7) >> 3) + 64 * seen[at] : counts[at];
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

/* ---- A run: each lane a work-item */

/* (7-2): each lane goes through the symbols backwards and takes those of its own, so that none waits for another. */
kernel void main_encode(global const uint *starts, global const uint *frequencies, global const uint *lanes, global uint *states,
                        global uint *emitted, Numbers told)
{
    uint lane = get_global_id(0);
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
#define LANE_COUNT ((uint)told.n[0])
#define FIRST_ROUND told.n[1]
#define ROUNDS told.n[2]
#define SLOT told.n[3]                      /* where a run has the number of symbols in front of these, */
#define FIRST_SLOT told.n[4]                /* and in front of the pass */
#define PASS_NUMBER told.n[5]
#define LISTED told.n[6]
#define ITEMS told.n[7]
#define CHOSEN_BY told.n[8]                 /* 0: the first distribution, 1: that of the item's choice, 2: of the item */
#define FIRST_CHOICE told.n[9]
#define SYMBOLS told.n[10]
#define MAGNITUDES told.n[11]               /* 1: symbols are classes of magnitudes */

/* Where a run has, after the states of its lanes: the next word of each group, the one after its last, how many symbols
   stand in front of each dispatch, and of all symbols c(s), f(s), pass and lane, 16 bits each. */
#define RUN_TAKEN 4096
#define RUN_ENDS 4224
#define RUN_SLOTS 4352
#define RUN_SYMBOLS 4608

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

/* Symbols of a pass: the code finds that of the item which this lane has in a round. Lanes that need a word find it after
   those of the lanes before (15.6). A word that is missing is 0; the host sees how many were needed. */
#define PASS(find_symbol) \
    local uint votes[2]; \
    uint of_group = get_local_id(0), lane = get_global_id(0), group = lane / MAIN_GROUP, x = run[lane]; \
    uint taken = run[RUN_TAKEN + group], in_front = run[RUN_SLOTS + SLOT], of_pass = in_front - run[RUN_SLOTS + FIRST_SLOT]; \
    uint count = LISTED ? list[0] : ITEMS, first_round = of_pass / LANE_COUNT + FIRST_ROUND; \
    uint end = (of_pass + count + LANE_COUNT - 1) / LANE_COUNT, rounds = min(max(end, first_round) - first_round, (uint)ROUNDS); \
    if (of_group < 2) \
        votes[of_group] = 0; \
    barrier(CLK_GLOBAL_MEM_FENCE | CLK_LOCAL_MEM_FENCE); \
    for (uint round = 0; round < rounds; round++) { \
        uint place = (first_round + round) * LANE_COUNT + lane, i = place - of_pass; \
        bool needs_word = false; \
        if (lane < LANE_COUNT && place >= of_pass && i < count) { \
            uint item = LISTED ? list[1 + i] : i, slot = x & 0x3FFF; \
            Symbol symbol; \
            find_symbol \
            global uint *noted = run + RUN_SYMBOLS + 2 * (in_front + i); \
            noted[0] = symbol.start | symbol.frequency << 16; \
            noted[1] = PASS_NUMBER | lane << 16; \
            x = symbol.frequency * (x >> 14) + slot - symbol.start;     /* (7-1) */ \
            needs_word = x < LOWEST_STATE; \
        } \
        if (needs_word) \
            atomic_or(votes + round % 2, 1u << of_group); \
        barrier(CLK_LOCAL_MEM_FENCE); \
        uint voted = votes[round % 2]; \
        if (needs_word) { \
            uint at = taken + popcount(voted & ((1u << of_group) - 1)); \
            x = x << 16 | (at < run[RUN_ENDS + group] ? words[at] : 0); \
        } \
        taken += popcount(voted); \
        barrier(CLK_LOCAL_MEM_FENCE); \
        if (of_group == 0) \
            votes[round % 2] = 0; \
    } \
    run[lane] = x; \
    if (of_group == 0) \
        run[RUN_TAKEN + group] = taken; \
    if (lane == 0) \
        run[RUN_SLOTS + SLOT + 1] = in_front + count;

kernel __attribute__((reqd_work_group_size(MAIN_GROUP, 1, 1)))
void main_read_modeled(global uint *run, global const ushort *words, global const uint *list, global const uint *choices,
                       global const uint *cumulative, global uint *values, global uint *seen, global uint *low_bits,
                       Numbers told)
{
    PASS(
        uint context = choice_of(item, choices, told);
        symbol = symbol_of_context(cumulative + context * (SYMBOLS + 1), SYMBOLS, slot);
        values[item] = symbol.value;
        low_bits[item] = MAGNITUDES ? bits_of_class(symbol.value) : 0;
        atomic_inc(seen + context * SYMBOLS + symbol.value);
    )
}

kernel __attribute__((reqd_work_group_size(MAIN_GROUP, 1, 1)))
void main_read_densities(global const uint *tables, global uint *run, global const ushort *words, global const uint *list,
                         global const uint *choices, global const Density *densities, global uint *values,
                         global uint *low_bits, Numbers told)
{
    PASS(
        Density density = densities[choice_of(item, choices, told)];
        symbol = symbol_of_density(tables, density, slot);
        values[item] = symbol.value;
        low_bits[item] = MAGNITUDES ? bits_of_class(symbol.value) : density.low_bits;
    )
}

/* ---- Raw values (15.6) */

#define VALUES ((uint)told.n[0])            /* items */
#define OF_SIGNS told.n[1]                  /* 1: a value has a bit where the number is not 0 */
#define LATE told.n[2]

uint raw_size(uint item, global const uint *numbers, Numbers told)
{
    return OF_SIGNS ? min(numbers[item], 1u) : numbers[item];
}

/* Where the values of items begin in the early string or the late one, which they lengthen. */
kernel __attribute__((reqd_work_group_size(MAIN_LANES, 1, 1)))
void main_offsets(global const uint *numbers, global uint *places, global uint *lengths, Numbers told)
{
    local uint own[MAIN_LANES];
    uint lane = get_local_id(0), sum = lengths[LATE];
    for (uint first = 0; first < VALUES; first += MAIN_LANES) {
        uint i = first + lane, before = sum;
        own[lane] = i < VALUES ? raw_size(i, numbers, told) : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint other = 0; other < MAIN_LANES; other++) {
            before += other < lane ? own[other] : 0;
            sum += own[other];
        }
        if (i < VALUES)
            places[i] = before;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    barrier(CLK_GLOBAL_MEM_FENCE);
    if (lane == 0)
        lengths[LATE] = sum;
}

uint word_of_text(global const uint *text, uint number)             /* 0 after its end */
{
    return number < text[0] ? text[1 + number] : 0;
}

uint bits_of_text(global const uint *text, uint at, uint size)
{
    uint shift = at % 32, upper = shift > 0 ? word_of_text(text, at / 32 + 1) << (32 - shift) : 0;
    return (word_of_text(text, at / 32) >> shift | upper) & ((1u << size) - 1);
}

/* Of the late string the first bits are the lower halves of what the lanes end with; the others follow the early bits. */
kernel void main_take(global const uint *numbers, global const uint *places, global const uint *lengths,
                      global const uint *text, global const uint *states, global uint *result, Numbers told)
{
    uint i = get_global_id(0);
    uint size = i < VALUES ? raw_size(i, numbers, told) : 0;
    if (size == 0)
        return;
    uint at = places[i], value = 0, of_lanes = 0;
    if (LATE) {
        uint half_bits = min(16 * (uint)told.n[3], lengths[1] / 16 * 16);
        of_lanes = min(size, max(half_bits, at) - at);
        if (of_lanes > 0) {
            uint pair = (states[at / 16] & 0xFFFF) | states[at / 16 + 1] << 16;
            value = pair >> at % 16 & ((1u << of_lanes) - 1);
        }
        at = lengths[0] + max(at, half_bits) - half_bits;
    }
    if (of_lanes < size)
        value |= bits_of_text(text, at, size - of_lanes) << of_lanes;
    result[told.n[4] + i * told.n[5]] = value;
}

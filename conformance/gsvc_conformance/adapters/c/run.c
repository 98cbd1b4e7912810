/* The entropy coder: distributions, and the run of a frame. */
#include "decoder.h"

/* Distributions. C of one bin is found alone, so that a lane needs no table of a density. */

u32 density_at(const struct distribution *d, u32 bin, i32 edge) { /* (15-6) */
    if (bin == 0 || bin == d->bins) return bin ? TOTAL : 0;
    const u32 *T = distributions[d->family];
    u32 shift = 2 + (d->scale_code + 3) / 4 + d->unit_bits;
    i32 slope = (i32)(exp2_table[(0 - 256 * d->scale_code) % 1024] >> 2);
    i32 u = clipped((1 << 15) + floor_shift((edge - 2 * d->centre) * slope, shift), 0, (1 << 16) - 1);
    u32 v = T[u >> 8] + ((T[(u >> 8) + 1] - T[u >> 8]) * (u & 255) >> 8);
    return bin + ((TOTAL - d->bins) * v >> 16);
}

u32 cumulative_at(const struct distribution *d, u32 bin) {
    return d->table ? d->table[bin] : density_at(d, bin, d->first_edge + ((i32)bin - 1) * d->edge_step);
}

struct distribution magnitude_density(u32 family, u32 scale_code, i32 centre) {
    struct distribution result = {NULL, MAGNITUDES, 16, 32, centre, family, scale_code, 2};
    return result;
}

struct window window_of(i32 centre, i32 step, u32 family, u32 scale_code) { /* (15-7) */
    i32 scale = exp2_of(256 * (i32)scale_code, 4);
    u32 low_bits = 0;
    while (16 * scale > 512 * (step << low_bits)) low_bits++;
    i32 width = step << low_bits, first = floor_divided(centre - 8 * scale, width);
    i32 last = -floor_divided(-centre - 8 * scale, width), edge = 2 * (first + 1) * width - step;
    struct window result = {
        {NULL, (u32)(last - first + 1), edge, 2 * width, centre, family, scale_code, 4}, first, low_bits};
    return result;
}

struct distribution half_of(u32 n, u32 p, u32 q, u32 alpha, u32 *low_bits) { /* `alpha` is an index */
    struct distribution result = {half_tables[alpha][n <= TABLED ? n : 0], n + 1, 64, 128, 0, 0, 0, 0};
    *low_bits = 0;
    if (p == q && n <= TABLED) return result;
    *low_bits = (u32)max_of(0, (i32)bit_length(n) - 9);
    u32 m = n >> *low_bits, b = 256 * p / (p + q), a = 2u * alphas[alpha]; /* (15-9) */
    u32 v = (m * b * (256 - b) >> 9) * ((a + m) * 1245 / (a + 1)) >> 7;
    u32 e = bit_length(v ? v : 1) - 1;
    result.table = NULL, result.bins = m + 1, result.centre = (i32)(m * b / 4);
    result.scale_code = 2 * e + (e ? v >> (e - 1) & 1 : 0);
    return result;
}

u32 magnitude_low_bits(u32 class) { return class < 4 ? 0 : class / 2 - 1; }

void model_frequencies(const u32 *counts, u32 symbols, u16 *cumulative) { /* (15-14): a thread for a context */
    u32 sum = 0, kept = 0, greatest = 0, left = TOTAL;
    for (u32 s = 0; s < symbols; s++) sum += counts[s];
    u32 shift = (u32)max_of(0, (i32)bit_length(sum) - 17);
    for (u32 s = 0; s < symbols; s++) kept += counts[s] >> shift;
    for (u32 s = 0; s < symbols; s++) {
        cumulative[s + 1] = (u16)(1 + (TOTAL - symbols) * (counts[s] >> shift) / kept);
        left -= cumulative[s + 1];
        if (cumulative[s + 1] > cumulative[greatest + 1]) greatest = s;
    }
    cumulative[greatest + 1] = (u16)(cumulative[greatest + 1] + left);
    cumulative[0] = 0;
    for (u32 s = 0; s < symbols; s++) cumulative[s + 1] = (u16)(cumulative[s + 1] + cumulative[s]);
}

void adapt_model(u32 *counts, const u32 *seen, u32 symbols) { /* (15-11): a thread for a context */
    bool used = false;
    for (u32 s = 0; s < symbols; s++) used |= seen[s] > 0;
    if (!used) return;
    for (u32 s = 0; s < symbols; s++) counts[s] += 64 * seen[s] - (counts[s] >> 3) - (counts[s] % 8 > 0);
}

/* The run (15.6): words from the front of the payload's rest, raw bits from its end. */

void begin_run(struct run *run, struct bits *bits, u32 lane_exponent) {
    run->decoder = bits->decoder;
    run->payload = bits->data;
    run->payload_bit = bits->first_bit;
    run->end = (u32)bits->size;
    run->lanes = 1u << lane_exponent;
    run->groups = run->lanes > GROUP ? run->lanes / GROUP : 1;
    run->early = run->late = run->late_at = run->in_states = 0;
    run->state_at = (u32)(bits->at / 8);
    need(bits, 32 * (u64)run->lanes);
    for (u32 lane = 0; lane < run->lanes; lane++) {
        run->states[lane] = read_le(bits, 4);
        if (run->states[lane] < LOWEST_STATE) fault(run->decoder, "R-6.6-5", bits->element);
    }
    u32 sum = 0;                                    /* words of all groups so far: a prefix sum */
    for (u32 group = 0; group < run->groups; group++) {
        run->next[group] = 2 * sum;
        if (group + 1 == run->groups) break;
        u32 count = read_uv(bits), left = run->end - (u32)(bits->at / 8);
        if (count > left / 2 || sum + count > left / 2) fault(run->decoder, "R-15.6-5", bits->element);
        sum += count;
    }
    run->words_at = (u32)(bits->at / 8);
    for (u32 group = 0; group < run->groups; group++) {
        run->next[group] += run->words_at;
        if (group > 0) run->limit[group - 1] = run->next[group];
    }
    run->limit[run->groups - 1] = run->end;
}

void begin_pass(struct run *run, u32 pass) { run->pass = pass, run->symbols = 0; }

static _Noreturn void end_fault(const struct run *run, u64 byte) {
    fault(run->decoder, "R-7-1", run->payload_bit + 8 * byte);
}

/* Symbol i of a pass is of lane i mod L (R-15.6-1). L lanes decode at once: those of a group that need a word take them
   in their order, so that a lane finds its word after those of the lanes before it (a ballot of 32). */
u32 next_symbol(struct run *run, const struct distribution *d) {
    u32 lane = run->symbols++ % run->lanes, group = lane / GROUP;
    u32 x = run->states[lane], slot = x % TOTAL, low = 0, high = d->bins, start = 0, end = TOTAL;
    while (high - low > 1) {                        /* C[low] <= slot < C[high] */
        u32 middle = (low + high) / 2, value = cumulative_at(d, middle);
        if (value <= slot) low = middle, start = value;
        else high = middle, end = value;
    }
    x = (end - start) * (x / TOTAL) + slot - start; /* (7-1) */
    if (x < LOWEST_STATE) {
        if (run->next[group] + 2 > run->limit[group]) end_fault(run, run->words_at);
        x = x << 16 | u16_at(run->payload + run->next[group]);
        run->next[group] += 2;
    }
    run->states[lane] = x;
    if (run->decoder->on_symbol) run->decoder->on_symbol(run->decoder->reader, start, end - start, run->pass, lane);
    return low;
}

static u32 raw_bits(const struct run *run, u32 first, u32 size) { /* at most 25 bits: one load, at any place */
    u32 value = 0;
    for (u32 k = 0; k < 4; k++) {
        u32 back = first / 8 + k + 1;
        if (back <= run->end - run->words_at) value |= (u32)run->payload[run->end - back] << 8 * k;
    }
    return value >> first % 8 & ((1u << size) - 1);
}

u32 early_bits(struct run *run, u32 size) {         /* of all items of a pass at once: a prefix sum of sizes */
    run->early += size;
    return raw_bits(run, run->early - size, size);
}

/* Late bits are visited twice in the same order: first they are counted, which is a prefix sum, then read. */
void begin_late(struct run *run, bool counting) {
    run->counting = counting;
    run->late_at = 0;
    if (!counting) run->in_states = 16 * (u32)min_of((i32)run->lanes, (i32)(run->late / 16));
}

u32 late_bits(struct run *run, u32 size) {
    u32 value = 0;
    if (run->counting) {
        run->late += size;
        return 0;
    }
    for (u32 have = 0, some; have < size; have += some, run->late_at += some) {
        u32 at = run->late_at, left = size - have;
        if (at < run->in_states) {                  /* of a final state: a value may go on in the next one */
            some = left < 16 - at % 16 ? left : 16 - at % 16;
            value |= (run->states[at / 16] >> at % 16 & ((1u << some) - 1)) << have;
        } else {
            some = left;
            value |= raw_bits(run, run->early + at - run->in_states, some) << have;
        }
    }
    return value;
}

void finish_run(struct run *run) {                  /* R-15.6-2 */
    for (u32 group = 0; group + 1 < run->groups; group++) {
        if (run->next[group] != run->limit[group]) end_fault(run, run->words_at);
    }
    for (u32 lane = 0; lane < run->lanes; lane++) {
        u32 most = lane < run->in_states / 16 ? 2 * LOWEST_STATE - 1 : LOWEST_STATE;
        if (run->states[lane] > most) end_fault(run, run->state_at + 4 * lane); /* none is below 2^16 */
    }
    u32 raw = run->early + run->late - run->in_states, bytes = (raw + 7) / 8;
    if (run->next[run->groups - 1] + bytes != run->end) end_fault(run, run->end - 1);
    if (raw % 8 && run->payload[run->end - bytes] >> raw % 8) end_fault(run, run->end - 1);
}

/* Profile paper: symbols of planes (spec.md 7), splats from their codes (8), and what is checked of a frame (5, 6.4).

   Every binary32 operation of section 8 is rounded by itself (R-3.3-2). */

#include "blocks.cuh"
#include "crc.cuh"
#include "rans.cuh"

#define SMALLEST_NORMAL 0x1p-126f
#define LARGEST 0x1.fffffep127f
#define REACH_64 0x1.aa1ee98abcac8p+1       /* rho' of section 5 */
#define CHECKSUM_WORDS 32                   /* of a thread */
#define MOST_LANES 64

/* ---- Planes. One warp, which has two lanes a thread. `cumulative` has room for a number more than there are frequencies. */

/* c(s) of every symbol, and 2^R after the last one. */
static __device__ __forceinline__ void add_up(const unsigned *frequencies, unsigned alphabet, unsigned precision,
                                              unsigned *cumulative)
{
    Share own = share_of(alphabet);
    unsigned sum = 0;
    for (unsigned s = own.first; s < own.end; s++)
        sum += frequencies[s];
    unsigned before = sum_before(sum).x;
    for (unsigned s = own.first; s < own.end; s++) {
        cumulative[s] = before;
        before += frequencies[s];
    }
    if (threadIdx.x == 0)
        cumulative[alphabet] = 1u << precision;
    __syncwarp();
}

extern "C" __global__ void decode_lanes(unsigned count, const unsigned *frequencies, unsigned alphabet, unsigned precision,
                                        unsigned lane_count, unsigned *states, const unsigned short *words,
                                        unsigned word_count, unsigned *cumulative, unsigned short *symbols, unsigned *taken)
{
    unsigned word = 0, x[2] = {};
    add_up(frequencies, alphabet, precision, cumulative);
    for (unsigned k = 0; k < 2; k++)
        x[k] = threadIdx.x + 32 * k < lane_count ? states[threadIdx.x + 32 * k] : 0;
    for (unsigned first = 0; first < count; first += lane_count)
        for (unsigned k = 0; k < 2; k++) {
            unsigned lane = threadIdx.x + 32 * k, i = first + lane;
            bool needs_word = false;
            if (lane < lane_count && i < count) {
                unsigned slot = x[k] & ((1u << precision) - 1);
                Symbol symbol = symbol_of_table(cumulative, alphabet, slot);
                x[k] = symbol.frequency * (x[k] >> precision) + slot - symbol.start;                /* (7-1) */
                needs_word = x[k] < LOWEST_STATE;
                symbols[i] = symbol.value;
            }
            unsigned needing = __ballot_sync(EVERY_LANE, needs_word);
            unsigned at = word + __popc(needing & ((1u << threadIdx.x) - 1));
            if (needs_word)
                x[k] = x[k] << 16 | (at < word_count ? words[at] : 0);
            word += __popc(needing);
        }
    for (unsigned k = 0; k < 2; k++)
        if (threadIdx.x + 32 * k < lane_count)
            states[threadIdx.x + 32 * k] = x[k];
    if (threadIdx.x == 0)
        *taken = word;
}

/* The words come in the order of encoding, which is the reverse of theirs; each symbol has an f(s) above 0. */
extern "C" __global__ void encode_lanes(unsigned count, const unsigned short *symbols, const unsigned *frequencies,
                                        unsigned alphabet, unsigned precision, unsigned lane_count, unsigned *cumulative,
                                        unsigned *states, unsigned short *emitted, unsigned *emitted_count)
{
    unsigned word = 0, x[2] = {LOWEST_STATE, LOWEST_STATE};
    add_up(frequencies, alphabet, precision, cumulative);
    for (unsigned round = (count + lane_count - 1) / lane_count; round-- > 0;)
        for (int k = 1; k >= 0; k--) {
            unsigned lane = threadIdx.x + 32 * k, i = round * lane_count + lane, symbol = 0, frequency = 1;
            bool encodes = lane < lane_count && i < count;
            if (encodes) {
                symbol = symbols[i];
                frequency = frequencies[symbol];
            }
            bool full = encodes && x[k] >> (32 - precision) >= frequency;       /* x >= f 2^(32 - R); once is enough */
            unsigned filled = __ballot_sync(EVERY_LANE, full);
            if (full) {
                emitted[word + __popc(filled >> threadIdx.x >> 1)] = (unsigned short)x[k];      /* higher lanes first */
                x[k] >>= 16;
            }
            if (encodes)
                x[k] = (x[k] / frequency << precision) + x[k] % frequency + cumulative[symbol];             /* (7-2) */
            word += __popc(filled);
        }
    for (unsigned k = 0; k < 2; k++)
        if (threadIdx.x + 32 * k < lane_count)
            states[threadIdx.x + 32 * k] = x[k];
    if (threadIdx.x == 0)
        *emitted_count = word;
}

/* ---- binary16 */

static __device__ __forceinline__ float value_of_half(unsigned bits)                        /* (8-5) */
{
    unsigned sign = bits >> 15 << 31, exponent = bits >> 10 & 31, fraction = bits & 1023;
    if (exponent == 0)
        return __uint_as_float(sign | __float_as_uint(__fmul_rn((float)fraction, 5.9604644775390625e-8f)));     /* 2^-24 */
    return __uint_as_float(sign | (exponent == 31 ? 255 : exponent + 112) << 23 | fraction << 13);
}

extern "C" __global__ void from_half(const unsigned short *bits, unsigned count, float *values)
{
    unsigned n = thread_of_grid();
    if (n < count)
        values[n] = value_of_half(bits[n]);
}

extern "C" __global__ void to_half(const float *values, unsigned count, unsigned short *bits)                   /* (8-6) */
{
    unsigned n = thread_of_grid();
    if (n >= count)
        return;
    unsigned pattern = __float_as_uint(values[n]), exponent = pattern >> 23 & 255, fraction = pattern & 0x7FFFFF;
    unsigned significand = exponent > 0 ? fraction | 0x800000 : fraction;       /* |v| is that times 2^(exponent - 150) */
    int of_half = max((int)exponent - 113, 0);                                  /* n + 14 */
    unsigned shift = min(13u + max(113 - (int)max(exponent, 1u), 0), 31u);
    unsigned k = (significand + (1u << (shift - 1)) - 1 + (significand >> shift & 1)) >> shift;
    bits[n] = (unsigned short)((pattern >> 31 << 15) + (of_half << 10) + k);
}

/* ---- Reconstruction */

/* What a splat block says of its attributes, row by row. */
struct Block {
    unsigned positions_present, cholesky_present, colors_present, stage_count;
    float half_width, half_height;          /* W/2 and H/2, exact */
};

struct Codes {
    const unsigned short *positions, *cholesky, *color_indices, *codewords;
    const float *scale, *offset;
    const unsigned *first;                  /* the first codeword of each stage */
};

static __device__ __forceinline__ float dequantized(const Codes &codes, unsigned n, int channel)
{
    return __fadd_rn(__fmul_rn((float)codes.cholesky[3 * (size_t)n + channel], codes.scale[channel]), codes.offset[channel]);
}

/* (8-4); the first codeword is not added to 0, which would lose the sign of -0. */
static __device__ float codeword_sum(const Codes &codes, unsigned stage_count, unsigned n, int channel)
{
    float sum = 0;
    for (unsigned k = 0; k < stage_count; k++) {
        unsigned chosen = codes.first[k] + codes.color_indices[(size_t)n * stage_count + k];
        float value = value_of_half(codes.codewords[3 * chosen + channel]);
        sum = k == 0 ? value : __fadd_rn(sum, value);
    }
    return sum;
}

extern "C" __global__ void reconstruct_intra(Codes codes, Block block, unsigned count, float *parameters)
{
    unsigned n = thread_of_grid();
    if (n >= count)
        return;
    float *p = parameters + 8 * (size_t)n;
    p[0] = __fmul_rn(__fadd_rn(value_of_half(codes.positions[2 * (size_t)n]), 1), block.half_width);            /* (8-1) */
    p[1] = __fmul_rn(__fadd_rn(value_of_half(codes.positions[2 * (size_t)n + 1]), 1), block.half_height);       /* (8-2) */
    for (int channel = 0; channel < 3; channel++) {
        p[2 + channel] = dequantized(codes, n, channel);                                                        /* (8-3) */
        p[5 + channel] = codeword_sum(codes, block.stage_count, n, channel);
    }
}

/* One block: where each survivor stands in the frame. */
extern "C" __global__ void rank_survivors(const unsigned short *survivors, unsigned count, unsigned *list)
{
    choose(count, list, [&](unsigned n) { return survivors[n] == 1; });
}

/* Of an attribute that is not present nothing is touched: to add 0 would turn -0 into +0 (R-6.5-10). */
extern "C" __global__ void reconstruct_inter(const float *reference, const unsigned *list, Codes codes, Block block,
                                             unsigned count, float *parameters)
{
    unsigned n = thread_of_grid();
    if (n >= count)
        return;
    const float *before = reference + 8 * (size_t)list[n];
    float *p = parameters + 8 * (size_t)n;
    for (int column = 0; column < 8; column++)
        p[column] = before[column];
    if (block.positions_present) {
        p[0] = __fadd_rn(p[0], __fmul_rn(value_of_half(codes.positions[2 * (size_t)n]), block.half_width));
        p[1] = __fadd_rn(p[1], __fmul_rn(value_of_half(codes.positions[2 * (size_t)n + 1]), block.half_height));
    }
    for (int channel = 0; channel < 3; channel++) {
        if (block.cholesky_present)
            p[2 + channel] = __fadd_rn(p[2 + channel], dequantized(codes, n, channel));
        if (block.colors_present)
            p[5 + channel] = __fadd_rn(p[5 + channel], codeword_sum(codes, block.stage_count, n, channel));
    }
}

/* ---- What is checked of a frame */

/* Pixels from floor(centre - e) to ceil(centre + e) inside of 0 .. size: (5-1). */
static __device__ __forceinline__ unsigned long long side_of_box(double centre, double e, double size)
{
    double first = fmax(floor(__dsub_rn(centre, e)), 0.0), end = fmin(ceil(__dadd_rn(centre, e)), size);
    return end > first ? (unsigned long long)(end - first) : 0;
}

extern "C" __global__ void rendering_work(const float *parameters, unsigned count, int width, int height,
                                          unsigned long long *work)
{
    unsigned n = thread_of_grid();
    if (n >= count)
        return;
    const float *p = parameters + 8 * (size_t)n;
    float l11 = p[2], l22 = p[4];
    if (l11 >= SMALLEST_NORMAL && l22 >= SMALLEST_NORMAL && l11 <= LARGEST && l22 <= LARGEST) {
        double e_x = __dmul_rn(REACH_64, l11), e_y = __dmul_rn(REACH_64, __dadd_rn(fabs((double)p[3]), l22));
        atomicAdd(work, side_of_box(p[0], e_x, width) * side_of_box(p[1], e_y, height));
    }
}

/* The k-th word of what the checksum is of: all positions, then all Cholesky factors, then all colours (R-6.4-3). */
static __device__ __forceinline__ unsigned checked_word(const unsigned *parameters, unsigned long long count, unsigned long long k)
{
    if (k < 2 * count)
        return parameters[k / 2 * 8 + k % 2];
    k -= 2 * count;
    unsigned column = k < 3 * count ? 2 : 5;
    k -= k < 3 * count ? 0 : 3 * count;
    return parameters[k / 3 * 8 + column + k % 3];
}

/* A thread has the remainder of its words, times x to the number of bits behind them; an exclusive or may be in any order.
   `checksum` is 0 before, and all bits of what it is then have to be turned; without splats it has no meaning. */
extern "C" __global__ void parameter_checksum(const unsigned *parameters, const unsigned *count, unsigned *checksum)
{
    unsigned long long words = 8ull * *count, first = (unsigned long long)thread_of_grid() * CHECKSUM_WORDS;
    if (first >= words)
        return;
    unsigned long long end = min(first + CHECKSUM_WORDS, words);
    unsigned remainder = first == 0 ? 0xFFFFFFFFu : 0;
    for (unsigned long long k = first; k < end; k++)
        remainder = crc_product(remainder ^ checked_word(parameters, *count, k), X_TO_32);
    atomicXor(checksum, crc_product(remainder, crc_power(X_TO_32, words - end)));
}

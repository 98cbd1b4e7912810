/* Profile main (spec.md 15): its tables, distributions and models. Integers of 32 bits only. */

#pragma once

#include "rans.cuh"

#define TOTAL 16384u                        /* 2^14, the sum of all frequencies */
#define ROWS 33                             /* contexts of all models, in this order: */
#define VECTOR 0
#define MODE 5
#define POSITION 15
#define SHAPE 19
#define COLOR 26
#define SYMBOLS 24                          /* of a context, at most */
#define MAGNITUDES 40                       /* classes of magnitudes */
#define CLASSES 11                          /* of splats */
#define WINDOW_MOST 520                     /* numbers of the frequencies of a window, at most */

struct Tables {
    unsigned exp2[1024];                    /* EXP2 */
    unsigned distributions[2][257];         /* LOGISTIC, LAPLACE */
    unsigned halves[8][15][17];             /* C of (15-8) by the index of alpha and n - 1 */
};

/* Bins 0 to bins - 1 with the doubled inner edges first_edge + (i - 1) edge_step, or a table of their C. */
struct Distribution {
    const unsigned *table;
    unsigned bins;
    int first_edge, edge_step, centre;
    unsigned family, scale_code, unit_bits;
};

struct Window {
    Distribution bins;
    int first;                              /* code of the first bin, without its low bits */
    unsigned low_bits;
};

static __device__ __forceinline__ int clipped(int value, int low, int high)
{
    return max(low, min(value, high));
}

static __device__ __forceinline__ unsigned bit_length(unsigned value)
{
    return 32 - __clz(value);
}

static __device__ __forceinline__ unsigned magnitude(int value)
{
    return value < 0 ? 0u - (unsigned)value : (unsigned)value;
}

/* floor(a / b) for b > 0, by unsigned quotients. */
static __device__ __forceinline__ int floor_quotient(int a, int b)
{
    return a < 0 ? -(int)((0u - (unsigned)a + b - 1) / b) : (int)((unsigned)a / b);
}

static __device__ __forceinline__ int exp2_of(const Tables &tables, int v, int k)           /* (15-2) */
{
    int shift = (v >> 10) - 15 + k;
    unsigned mantissa = tables.exp2[v & 1023];
    return shift >= 0 ? mantissa << shift : mantissa >> min(-shift, 31);
}

/* The v of (15-6) at an edge. */
static __device__ __forceinline__ unsigned reached(const Tables &tables, const Distribution &d, int edge)
{
    int slope = tables.exp2[(0 - 256 * d.scale_code) & 1023] >> 2;
    unsigned shift = 2 + (d.scale_code + 3) / 4 + d.unit_bits;
    unsigned u = clipped(32768 + ((edge - 2 * d.centre) * slope >> shift), 0, 65535);
    const unsigned *T = tables.distributions[d.family] + (u >> 8);
    return T[0] + ((T[1] - T[0]) * (u & 255) >> 8);
}

static __device__ __forceinline__ unsigned density_at(const Tables &tables, const Distribution &d, unsigned i, int edge)
{
    return i + ((TOTAL - d.bins) * reached(tables, d, edge) >> 16);
}

static __device__ __forceinline__ unsigned cumulative_at(const Tables &tables, const Distribution &d, unsigned i)   /* C[i] */
{
    if (d.table)
        return d.table[i];
    if (i == 0 || i == d.bins)
        return i == 0 ? 0 : TOTAL;
    return density_at(tables, d, i, d.first_edge + (int)(i - 1) * d.edge_step);
}

static __device__ Distribution magnitude_density(unsigned family, unsigned scale_code, int centre)
{
    return {nullptr, MAGNITUDES, 16, 32, centre, family, scale_code, 2};
}

static __device__ Window window_density(const Tables &tables, int centre, int step, unsigned family, unsigned scale_code)
{
    int scale = exp2_of(tables, 256 * scale_code, 4);
    unsigned r = 0;
    while (16 * scale > 512 * (step << r))
        r++;
    int width = step << r, first = floor_quotient(centre - 8 * scale, width);                       /* (15-7) */
    int last = -floor_quotient(-centre - 8 * scale, width), edge = 2 * (first + 1) * width - step;
    return {{nullptr, (unsigned)(last - first + 1), edge, 2 * width, centre, family, scale_code, 4}, first, r};
}

static __device__ __forceinline__ unsigned low_bits_of_half(unsigned n)
{
    return max(0, (int)bit_length(n) - 9);
}

__constant__ unsigned ALPHAS[8] = {1, 2, 3, 4, 6, 10, 20, 100};

/* How many of n splats are in the first half, p and q being the cells of both (15.8). */
static __device__ Distribution half_density(const Tables &tables, unsigned n, unsigned p, unsigned q, unsigned halving_code)
{
    if (p == q && n <= 15)
        return {tables.halves[halving_code][n - 1], n + 1, 0, 0, 0, 0, 0, 0};
    unsigned m = n >> low_bits_of_half(n), b = 256 * p / (p + q), a = 2 * ALPHAS[halving_code];
    unsigned v = (m * b * (256 - b) >> 9) * ((a + m) * 1245 / (a + 1)) >> 7;                /* (15-9) */
    unsigned e = bit_length(max(v, 1u)) - 1;
    return {nullptr, m + 1, 64, 128, (int)(m * b / 4), 0, 2 * e + (e > 0 ? v >> (e - 1) & 1 : 0), 0};
}

static __device__ __forceinline__ unsigned bits_of_class(unsigned q)
{
    return q < 4 ? 0 : q / 2 - 1;
}

static __device__ __forceinline__ int magnitude_of(unsigned q, unsigned low)
{
    return q < 4 ? q : ((2 + q % 2) << bits_of_class(q)) + low;
}

static __device__ __forceinline__ unsigned symbols_of(unsigned row)
{
    return row >= MODE && row < POSITION ? 9 : SYMBOLS;
}

/* (15-14) of one context: C[0] to C[symbols]. */
template <class Number> __device__ void context_frequencies(const unsigned *counts, unsigned symbols, Number *C)
{
    unsigned sum = 0, kept = 0, missing = TOTAL, most = 0, greatest = 0, before = 0;
    ROLLED for (unsigned s = 0; s < symbols; s++)
        sum += counts[s];
    unsigned shift = max(0, (int)bit_length(sum) - 17);
    ROLLED for (unsigned s = 0; s < symbols; s++)
        kept += counts[s] >> shift;
    ROLLED for (unsigned s = 0; s < symbols; s++) {
        unsigned f = 1 + (TOTAL - symbols) * (counts[s] >> shift) / kept;
        missing -= f;
        if (f > greatest) {
            most = s;
            greatest = f;
        }
    }
    ROLLED for (unsigned s = 0; s <= symbols; s++) {
        C[s] = before;
        before += s < symbols ? 1 + (TOTAL - symbols) * (counts[s] >> shift) / kept + (s == most ? missing : 0) : 0;
    }
}

/* (15-11) of one context. */
static __device__ void adapt_context(const unsigned *counts, const unsigned *seen, unsigned symbols, unsigned *after)
{
    unsigned used = 0;
    ROLLED for (unsigned s = 0; s < symbols; s++)
        used |= seen[s];
    ROLLED for (unsigned s = 0; s < symbols; s++)
        after[s] = used ? counts[s] - ((counts[s] + 7) >> 3) + 64 * seen[s] : counts[s];
}

/* The symbol of a slot, without a table of C. */
static __device__ __forceinline__ Symbol symbol_of_density(const Tables &tables, const Distribution &d, unsigned slot)
{
    unsigned low = 0, high = d.bins, start = 0, end = TOTAL;
    ROLLED while (high - low > 1) {
        unsigned middle = (low + high) / 2, value = cumulative_at(tables, d, middle);
        if (value <= slot) {
            low = middle;
            start = value;
        } else {
            high = middle;
            end = value;
        }
    }
    return {low, start, end - start};
}

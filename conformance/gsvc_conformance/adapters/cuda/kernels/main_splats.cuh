/* Profile main: what is done to each splat by itself (spec.md 5 and 15.4, 15.9 to 15.11). */

#pragma once

#include "main_tables.cuh"

#define X_MOST (1 << 24)
#define A_LEAST -3072
#define A_MOST 13311
#define S_MOST 32767
#define N_MOST (1 << 28)
#define STEP_MOST 131071
#define REMOVED 8

struct State {
    int X, Y, A, B, S, n[3];                /* (15.4), 32 bytes */
};

__constant__ int MAIN_K[3] = {42862, 52495, 30308};
__constant__ int HALVED_REACH[4] = {0, 427, 953, 1953};     /* F_h */

struct Field {
    int side, columns, rows;                /* side 0: there is none */
    const int2 *vectors;
};

static __device__ __forceinline__ int sign_of(int value)
{
    return (value > 0) - (value < 0);
}

static __device__ __forceinline__ int step_of(const Tables &tables, unsigned quantizer)    /* D */
{
    return tables.exp2[128 * (quantizer % 8)] << (quantizer / 8) >> 12;
}

static __device__ __forceinline__ int splat_class(const int *n, int D)                      /* (15-4) */
{
    unsigned energy = 0;
    for (int c = 0; c < 3; c++) {
        unsigned k = min((magnitude(n[c]) + D / 2) / D, 1024u);
        energy += k * k;
    }
    return min(bit_length(energy) / 2, CLASSES - 1u);
}

static __device__ __forceinline__ int size_step(int j)                                      /* h_j */
{
    return 1477 >> j;
}

static __device__ __forceinline__ int shear_step(int j)
{
    return 2048 >> j;
}

static __device__ __forceinline__ State clipped_state(State s)                              /* R-15.4-1 */
{
    s.X = clipped(s.X, -X_MOST, X_MOST);
    s.Y = clipped(s.Y, -X_MOST, X_MOST);
    s.A = clipped(s.A, A_LEAST, A_MOST);
    s.B = clipped(s.B, A_LEAST, A_MOST);
    s.S = clipped(s.S, -S_MOST, S_MOST);
    for (int c = 0; c < 3; c++)
        s.n[c] = clipped(s.n[c], -N_MOST, N_MOST);
    return s;
}

/* ---- New splats (15.9) */

static __device__ __forceinline__ int coded_color(int k, int D)
{
    return clipped(k, -(N_MOST / D), N_MOST / D) * D;
}

static __device__ __forceinline__ int log_size(int size, int aspect, int j, int axis)      /* A or B of (15-10) */
{
    return clipped((axis ? size - aspect : size + aspect) * size_step(j), A_LEAST, A_MOST);
}

static __device__ __forceinline__ int place_step(int size, int aspect, int j, int axis)    /* g */
{
    return clipped((log_size(size, aspect, j, axis) >> 10) + 1 - j, -4, 2);
}

static __device__ __forceinline__ int position_of(int cell, int place, int g)              /* (15-15) */
{
    return 1024 * cell + (place << (g + 8)) + (1 << (g + 7));
}

static __device__ State intra_state(const int *cell, const int *colors, const int *shape, const int *place, int D)    /* (15-10) */
{
    State s;
    for (int c = 0; c < 3; c++)
        s.n[c] = coded_color(colors[c], D);
    int j = splat_class(s.n, D);
    s.X = position_of(cell[0], place[0], place_step(shape[0], shape[1], j, 0));
    s.Y = position_of(cell[1], place[1], place_step(shape[0], shape[1], j, 1));
    s.A = log_size(shape[0], shape[1], j, 0);
    s.B = log_size(shape[0], shape[1], j, 1);
    s.S = shape[2] * shear_step(j);
    return clipped_state(s);
}

/* ---- Motion (15.10) */

/* The cell before a position, the one after it, and the 64ths of the way between their centres. */
static __device__ __forceinline__ int3 between(int position, int side, int cells)
{
    int b = bit_length(256 * side) - 1;
    int u = clipped(position - 128 * side, 0, (cells - 1) << b), i = min(u >> b, max(cells - 2, 0));
    return make_int3(i, min(i + 1, cells - 1), (u - (i << b)) >> (b - 6));
}

static __device__ __forceinline__ int mixed(int a, int b, int sixty_fourths)
{
    return (64 - sixty_fourths) * a + sixty_fourths * b;
}

static __device__ int2 motion_of_splat(const State &s, const Field &field)                  /* (15-12) */
{
    if (field.side == 0)
        return make_int2(0, 0);
    int3 x = between(s.X, field.side, field.columns), y = between(s.Y, field.side, field.rows);
    const int2 *upper = field.vectors + y.x * field.columns, *lower = field.vectors + y.y * field.columns;
    int2 a = upper[x.x], b = upper[x.y], c = lower[x.x], d = lower[x.y];
    return make_int2((mixed(mixed(a.x, b.x, x.z), mixed(c.x, d.x, x.z), y.z) + 32) >> 6,
                     (mixed(mixed(a.y, b.y, x.z), mixed(c.y, d.y, x.z), y.z) + 32) >> 6);
}

static __device__ __forceinline__ unsigned difference_of(const Field &field, int2 own, int column, int row)
{
    if (column < 0 || column >= field.columns || row < 0 || row >= field.rows)
        return 0;
    int2 other = field.vectors[row * field.columns + column];
    return magnitude(other.x - own.x) + magnitude(other.y - own.y);
}

/* ---- P-frames (15.11) */

static __device__ unsigned mode_context(const State &s, unsigned past, int2 motion, const Field &field, int width, int height)
{
    int x = s.X + motion.x, y = s.Y + motion.y;
    unsigned unrest = 0;
    if (x < 0 || y < 0 || (unsigned)x >= 256u * width || (unsigned)y >= 256u * height)
        return 9;
    if (field.side > 0) {
        int b = bit_length(256 * field.side) - 1;
        int column = clipped(s.X >> b, 0, field.columns - 1), row = clipped(s.Y >> b, 0, field.rows - 1);
        int2 own = field.vectors[row * field.columns + column];
        unrest = max(max(difference_of(field, own, column - 1, row), difference_of(field, own, column + 1, row)),
                     max(difference_of(field, own, column, row - 1), difference_of(field, own, column, row + 1)));
    }
    return 3 * past + (unrest > 2) + (unrest > 7);
}

/* The first term of S in (15-13). */
static __device__ __forceinline__ int sheared(const Tables &tables, int S, int v)
{
    unsigned size = magnitude(S) * tables.exp2[v & 1023] >> clipped(15 - (v >> 10), 0, 31);
    return sign_of(S) * (int)min(size, (unsigned)S_MOST);
}

static __device__ State inter_state(const Tables &tables, const State &before, int2 motion, const int *q, int D)      /* (15-13) */
{
    State s = before;
    int j = splat_class(s.n, D);
    int g_x = clipped(exp2_of(tables, s.A + 512 - 1024 * j, 8), 1, STEP_MOST);
    int g_y = clipped(exp2_of(tables, s.B + 512 - 1024 * j, 8), 1, STEP_MOST);
    int g_s = sign_of(s.S) * (int)min(magnitude(s.S) * g_y >> 10, (unsigned)STEP_MOST);
    s.X += motion.x + q[0] * g_x;
    s.Y += motion.y + q[0] * g_s + q[1] * g_y;
    s.A = clipped(s.A + (q[2] + q[3]) * size_step(j), A_LEAST, A_MOST);
    s.B = clipped(s.B + (q[2] - q[3]) * size_step(j), A_LEAST, A_MOST);
    s.S = sheared(tables, s.S, (s.A - before.A) - (s.B - before.B)) + q[4] * shear_step(j);
    for (int c = 0; c < 3; c++)
        s.n[c] += q[5 + c] * D;
    return clipped_state(s);
}

/* ---- Parameters (15-5) as bit patterns, and work (5-2): no floating point */

/* sign q 2^(e + k) with (q, e) = r24(p). No number here is subnormal or beyond binary32. */
static __device__ __forceinline__ unsigned pattern(int sign, unsigned p, int k)
{
    unsigned e = max((int)bit_length(p) - 24, 0);
    unsigned q = e > 0 ? (p + (1u << (e - 1)) - 1 + (p >> e & 1)) >> e : p, z = bit_length(q);     /* 25 if q is 2^24 */
    unsigned fraction = z > 24 ? 0 : q << (24 - z) & 0x7FFFFF;
    return q == 0 ? 0 : (sign < 0 ? 0x80000000 : 0) | (unsigned)(k + (int)(e + z) + 126) << 23 | fraction;
}

static __device__ __forceinline__ unsigned weighted(int T, unsigned G, int k)
{
    unsigned size = magnitude(T);
    return pattern(T, (size >> 15) * G + ((size & 0x7FFF) * G >> 15), k);
}

static __device__ void parameters_of(const Tables &tables, const State &t, unsigned *parameters)
{
    unsigned most = max(max(magnitude(t.n[0]), magnitude(t.n[1])), magnitude(t.n[2]));
    int s = max((int)bit_length(most) - 14, 0), v = -(t.A + t.B) >> 1, P[3];
    for (int c = 0; c < 3; c++)
        P[c] = (t.n[c] >> s) * MAIN_K[c] + (int)((t.n[c] & ((1u << s) - 1)) * MAIN_K[c] >> s);
    unsigned G = tables.exp2[v & 1023], of_A = tables.exp2[t.A & 1023], of_B = tables.exp2[t.B & 1023];
    int of_color = s + (v >> 10) - 29;
    parameters[0] = pattern(t.X, magnitude(t.X), -8);
    parameters[1] = pattern(t.Y, magnitude(t.Y), -8);
    parameters[2] = pattern(1, of_A, (t.A >> 10) - 15);
    parameters[3] = pattern(t.S, magnitude(t.S) * of_B, (t.B >> 10) - 25);
    parameters[4] = pattern(1, of_B, (t.B >> 10) - 15);
    parameters[5] = weighted(P[0] + P[1] + P[2], G, of_color);
    parameters[6] = weighted(P[0] - 2 * P[2], G, of_color);
    parameters[7] = weighted(P[0] - P[1] + P[2], G, of_color);
}

static __device__ __forceinline__ int reach_of(const Tables &tables, int v)                 /* E_x from A, or e from B */
{
    return (int)(tables.exp2[v & 1023] * 54544 >> (21 - (v >> 10))) + 1;
}

static __device__ __forceinline__ unsigned side_of_box(int middle, int reach, int size, unsigned h)
{
    int far = reach + HALVED_REACH[h], end = min((size + (1 << h) - 1) >> h, (middle + far + (256 << h) - 1) >> (8 + h));
    return max(0, end - max(0, (middle - far) >> (8 + h)));
}

static __device__ unsigned work_of(const Tables &tables, const State &t, int width, int height, unsigned h)          /* (5-2) */
{
    int m = 1024 + (int)magnitude(t.S), e = reach_of(tables, t.B);
    int e_y = (e >> 10) * m + (int)((unsigned)(e & 1023) * m >> 10) + 1;
    return side_of_box(t.X, reach_of(tables, t.A), width, h) * side_of_box(t.Y, e_y, height, h);
}

/* What is done to each splat by itself: every function here is the body of a kernel with one thread for a splat. */
#include <string.h>

#include "decoder.h"

enum { X_MOST = 1 << 24, A_LEAST = -3072, A_MOST = 13311, S_MOST = 32767, N_MOST = 1 << 28, STEP_MOST = (1 << 17) - 1 };

i32 exp2_of(i32 v, i32 k) {                         /* (15-2); what is needed of it is below 2^31 */
    i32 shift = floor_shift(v, 10) - 15 + k;
    u32 mantissa = exp2_table[v & 1023];
    return (i32)(shift >= 0 ? mantissa << shift : mantissa >> min_of(-shift, 31));
}

i32 step_of(u32 quantizer) { return (i32)(exp2_table[128 * (quantizer % 8)] << (quantizer / 8) >> 12); }

i32 size_step(i32 j) { return 1477 >> j; }

i32 shear_step(i32 j) { return 2048 >> j; }

static i32 sign_of(i32 value) { return (value > 0) - (value < 0); }

static u32 size_of(i32 value) { return value < 0 ? 0u - (u32)value : (u32)value; }

i32 class_of(const i32 n[3], i32 D) {               /* (15-4) */
    u32 energy = 0;
    for (u32 c = 0; c < 3; c++) {
        u32 k = (size_of(n[c]) + (u32)D / 2) / (u32)D;
        energy += k < 1024 ? k * k : 1 << 20;
    }
    return min_of((i32)bit_length(energy) / 2, CLASSES - 1);
}

static struct splat clipped_state(struct splat s) { /* R-15.4-1 */
    struct splat result = {
        clipped(s.X, -X_MOST, X_MOST), clipped(s.Y, -X_MOST, X_MOST),
        clipped(s.A, A_LEAST, A_MOST), clipped(s.B, A_LEAST, A_MOST), clipped(s.S, -S_MOST, S_MOST),
        {clipped(s.n[0], -N_MOST, N_MOST), clipped(s.n[1], -N_MOST, N_MOST), clipped(s.n[2], -N_MOST, N_MOST)}};
    return result;
}

/* Splats of an I-frame, and new ones (15.9). */

void color_of(const i32 k[3], i32 D, i32 n[3]) {
    for (u32 c = 0; c < 3; c++) n[c] = clipped(k[c], -(N_MOST / D), N_MOST / D) * D;
}

static i32 log_size(const struct codes *codes, i32 j, i32 axis) { /* A or B of (15-10) */
    i32 k = axis ? codes->shape[0] - codes->shape[1] : codes->shape[0] + codes->shape[1];
    return clipped(k * size_step(j), A_LEAST, A_MOST);
}

static i32 place_step(const struct codes *codes, i32 j, i32 axis) { /* g */
    return clipped(floor_shift(log_size(codes, j, axis), 10) + 1 - j, -4, 2);
}

u32 place_bits(const struct codes *codes, i32 j, i32 axis) { return (u32)(2 - place_step(codes, j, axis)); }

struct splat intra_state(const struct codes *codes, i32 D) { /* (15-10), (15-15) */
    struct splat s;
    color_of(codes->color, D, s.n);
    i32 j = class_of(s.n, D), place[2];
    for (i32 axis = 0; axis < 2; axis++) {
        i32 g = place_step(codes, j, axis);
        place[axis] = 1024 * (axis ? codes->row : codes->column) + (codes->place[axis] << (g + 8)) + (1 << (g + 7));
    }
    s.X = place[0], s.Y = place[1];
    s.A = log_size(codes, j, 0), s.B = log_size(codes, j, 1);
    s.S = codes->shape[2] * shear_step(j);
    return clipped_state(s);
}

/* Splats that stay (15.11). */

static i32 sheared(i32 S, i32 v) {                  /* the first term of S in (15-13) */
    u32 size = size_of(S) * exp2_table[v & 1023] >> clipped(15 - floor_shift(v, 10), 0, 31);
    return sign_of(S) * (i32)(size < S_MOST ? size : S_MOST);
}

struct splat inter_state(const struct splat *before, const i32 motion[2], const i32 q[8], i32 D) { /* (15-13) */
    struct splat s = *before;
    i32 j = class_of(s.n, D);
    i32 g_x = clipped(exp2_of(s.A + 512 - 1024 * j, 8), 1, STEP_MOST);
    i32 g_y = clipped(exp2_of(s.B + 512 - 1024 * j, 8), 1, STEP_MOST);
    u32 sheared_step = size_of(s.S) * (u32)g_y >> 10;
    i32 g_s = sign_of(s.S) * (i32)(sheared_step < STEP_MOST ? sheared_step : STEP_MOST);
    s.X += motion[0] + q[0] * g_x;
    s.Y += motion[1] + q[0] * g_s + q[1] * g_y;
    s.A = clipped(s.A + (q[2] + q[3]) * size_step(j), A_LEAST, A_MOST);
    s.B = clipped(s.B + (q[2] - q[3]) * size_step(j), A_LEAST, A_MOST);
    s.S = sheared(s.S, (s.A - before->A) - (s.B - before->B)) + q[4] * shear_step(j);
    for (u32 c = 0; c < 3; c++) s.n[c] += q[5 + c] * D;
    return clipped_state(s);
}

/* Parameters (15.4). */

static u32 rounded_24(u32 p, i32 *e) {              /* q and e of r24(p) */
    i32 bits = (i32)bit_length(p);
    *e = max_of(0, bits - 24);
    return *e ? (p + (1u << (*e - 1)) - 1 + (p >> *e & 1)) >> *e : p;
}

static float scaled(i32 q, i32 k) {                 /* q 2^k, exactly: |q| is at most 2^24, k is -42 to -3 */
    u32 bits = (u32)(k + 127) << 23;
    float power;
    memcpy(&power, &bits, sizeof power);
    return (float)q * power;
}

static float power_of(i32 v) { return scaled((i32)exp2_table[v & 1023], floor_shift(v, 10) - 15); }

void parameters_of(const struct splat *s, float parameters[8]) { /* (15-5) */
    static const u32 k[3] = {42862, 52495, 30308};
    u32 most = 0;
    for (u32 c = 0; c < 3; c++) if (size_of(s->n[c]) > most) most = size_of(s->n[c]);
    i32 shift = max_of(0, (i32)bit_length(most) - 14), P[3], e;
    for (u32 c = 0; c < 3; c++) {
        u32 low = (u32)s->n[c] & ((1u << shift) - 1);
        P[c] = floor_shift(s->n[c], (u32)shift) * (i32)k[c] + (i32)(low * k[c] >> shift);
    }
    i32 v = floor_shift(-(s->A + s->B), 1), T[3] = {P[0] + P[1] + P[2], P[0] - 2 * P[2], P[0] - P[1] + P[2]};
    for (u32 c = 0; c < 3; c++) {
        u32 size = size_of(T[c]), G = exp2_table[v & 1023];
        u32 q = rounded_24((size >> 15) * G + ((size & 0x7FFF) * G >> 15), &e);
        parameters[5 + c] = scaled(sign_of(T[c]) * (i32)q, e + shift + floor_shift(v, 10) - 29);
    }
    u32 q = rounded_24(size_of(s->S) * exp2_table[s->B & 1023], &e);
    parameters[0] = scaled(s->X, -8), parameters[1] = scaled(s->Y, -8);
    parameters[2] = power_of(s->A), parameters[4] = power_of(s->B);
    parameters[3] = scaled(sign_of(s->S) * (i32)q, e + floor_shift(s->B, 10) - 25);
}

u32 checksum_of(const struct splat *splats, u32 count) { /* R-6.4-3 */
    static const u32 parts[4] = {0, 2, 5, 8};
    u32 checksum = 0;
    for (u32 part = 0; part < 3; part++) {
        for (u32 n = 0; n < count; n++) {
            float parameters[8];
            parameters_of(&splats[n], parameters);
            checksum = crc32c(checksum, parameters + parts[part], 4 * (parts[part + 1] - parts[part]));
        }
    }
    return checksum;
}

static i32 cells_between(i32 centre, i32 reach, u32 side, u32 halvings) { /* columns or rows of (5-2) */
    i32 end = floor_shift(centre + reach + (256 << halvings) - 1, 8 + halvings);
    return max_of(0, min_of((i32)halved(side, halvings), end) - max_of(0, floor_shift(centre - reach, 8 + halvings)));
}

static i32 support_of(i32 v) { return (i32)(exp2_table[v & 1023] * 54544 >> (21 - floor_shift(v, 10))) + 1; }

u64 work_of(const struct splat *splats, u32 count, u32 width, u32 height, u32 halvings) { /* (5-2) */
    static const i32 filter[4] = {0, 427, 953, 1953};
    u64 work = 0;                                   /* a sum over all threads */
    for (u32 n = 0; n < count; n++) {
        const struct splat *s = &splats[n];
        i32 e = support_of(s->B), m = 1024 + (i32)size_of(s->S);
        i32 e_x = support_of(s->A) + filter[halvings];
        i32 e_y = floor_shift(e, 10) * m + (i32)((u32)(e & 1023) * (u32)m >> 10) + 1 + filter[halvings];
        work += (u64)cells_between(s->X, e_x, width, halvings) * (u64)cells_between(s->Y, e_y, height, halvings);
    }
    return work;
}

/* Motion (15.10). */

static const u32 sides[4] = {0, 64, 32, 16};

u32 cells_of(u32 side, u32 motion_cell) { return (side + sides[motion_cell] - 1) / sides[motion_cell]; }

static void between(i32 position, u32 side, u32 cells, u32 *first, u32 *second, i32 *sixty_fourths) {
    u32 b = bit_length(256 * side) - 1, most = (cells - 1) << b;
    u32 u = (u32)clipped(position - 128 * (i32)side, 0, (i32)most);
    *first = (u32)min_of((i32)(u >> b), max_of((i32)cells - 2, 0));
    *second = *first + 1 < cells ? *first + 1 : cells - 1;
    *sixty_fourths = (i32)((u - (*first << b)) >> (b - 6));
}

void motion_of(const struct splat *splat, const struct field *field, i32 motion[2]) { /* (15-12) */
    motion[0] = motion[1] = 0;
    if (!field->cell) return;
    u32 i, i1, j, j1;
    i32 f, h;
    between(splat->X, sides[field->cell], field->columns, &i, &i1, &f);
    between(splat->Y, sides[field->cell], field->rows, &j, &j1, &h);
    const i32(*upper)[2] = (const i32(*)[2])field->vectors + j * field->columns;
    const i32(*lower)[2] = (const i32(*)[2])field->vectors + j1 * field->columns;
    for (u32 axis = 0; axis < 2; axis++) {
        i32 above = (64 - f) * upper[i][axis] + f * upper[i1][axis];
        i32 below = (64 - f) * lower[i][axis] + f * lower[i1][axis];
        motion[axis] = floor_shift((64 - h) * above + h * below + 32, 6);
    }
}

void find_unrest(struct field *field) {             /* t of 15.11 of each cell: a kernel with a thread for a cell */
    static const i32 steps[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    i32 columns = (i32)field->columns, rows = (i32)field->rows;
    for (i32 cell = 0; cell < columns * rows; cell++) {
        u32 most = 0;
        for (u32 k = 0; k < 4; k++) {
            i32 column = cell % columns + steps[k][0], row = cell / columns + steps[k][1];
            if (column < 0 || column >= columns || row < 0 || row >= rows) continue;
            const i32 *here = field->vectors[cell], *there = field->vectors[row * columns + column];
            u32 change = size_of(here[0] - there[0]) + size_of(here[1] - there[1]);
            if (change > most) most = change;
        }
        field->unrest[cell] = most < 3 ? 0 : most < 8 ? 1 : 2;
    }
}

u32 mode_context(const struct splat *splat, u32 past, const i32 motion[2], const struct field *field, u32 width,
                 u32 height) {
    i32 x = splat->X + motion[0], y = splat->Y + motion[1];
    if (x < 0 || y < 0 || (u32)x >= 256 * width || (u32)y >= 256 * height) return 9;
    if (!field->cell) return 3 * past;
    u32 bits = bit_length(256 * sides[field->cell]) - 1;
    i32 column = clipped(floor_shift(splat->X, bits), 0, (i32)field->columns - 1);
    i32 row = clipped(floor_shift(splat->Y, bits), 0, (i32)field->rows - 1);
    return 3 * past + field->unrest[row * (i32)field->columns + column];
}

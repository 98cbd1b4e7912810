/* Profile main (section 15): cells, codes, the motion field and states, a work-item for each part, splat or cell. */

typedef struct {
    int column, row;                        /* of its first cell */
    uint splats;
} Part;

#define N_MOST (1 << 28)
#define STEP_MOST 131071

int main_class(int3 n, int step)                                    /* (15-4) */
{
    int3 k = min((convert_int3(abs(n)) + step / 2) / step, 1024);
    uint energy = k.x * k.x + k.y * k.y + k.z * k.z;
    int j = 0;
    while (j < 10 && energy >= 1u << (2 * j + 1))
        j++;
    return j;
}

/* ---- Cells (15.8). The list says how many parts there are; one that is not there has no splats. */

#define HALVED_PARTS told.n[0]              /* at most */
#define HALVED_AXIS told.n[1]
#define HALF_SIZE told.n[2]
#define HALF_INSIDE told.n[3]

int second_half(Part part, Numbers told)
{
    return min(HALF_SIZE, HALF_INSIDE - (HALVED_AXIS ? part.row : part.column) - HALF_SIZE);
}

kernel void main_ask(global const Part *parts, global const uint *list, global Density *densities, global uint *asked,
                     Numbers told)
{
    uint i = get_global_id(0);
    if (i >= HALVED_PARTS)
        return;
    asked[i] = 0;
    if (i < list[0]) {
        Part part = parts[list[1 + i]];
        int second = second_half(part, told);
        if (second > 0) {
            asked[i] = 1;
            densities[i] = half_density(part.splats, HALF_SIZE, second, told.n[4]);
        }
    }
}

kernel void main_halve(global const Part *parts, global const uint *list, global const Density *densities,
                       global const uint *bins, global const uint *low, global Part *halves, Numbers told)
{
    uint i = get_global_id(0);
    if (i >= HALVED_PARTS)
        return;
    Part first = {0, 0, 0}, second;
    second = first;
    if (i < list[0]) {
        first = second = parts[list[1 + i]];
        if (second_half(first, told) > 0)
            first.splats = min((bins[i] << densities[i].low_bits) + low[i], first.splats);
        second.splats -= first.splats;
        if (HALVED_AXIS)
            second.row += HALF_SIZE;
        else
            second.column += HALF_SIZE;
    }
    halves[2 * i] = first;
    halves[2 * i + 1] = second;
}

/* The cell of each splat: that of the last part that does not begin after it. */
kernel void main_locate(global const Part *parts, global const uint *list, global const uint *first_splats, global int *cells,
                        Numbers told)
{
    uint i = get_global_id(0), begin = 0, end = list[0];
    if (i >= told.n[0])
        return;
    while (end - begin > 1) {
        uint middle = (begin + end) / 2;
        if (first_splats[middle] <= i)
            begin = middle;
        else
            end = middle;
    }
    cells[2 * i] = parts[list[1 + begin]].column;
    cells[2 * i + 1] = parts[list[1 + begin]].row;
}

/* ---- New splats (15.9) */

/* What the kernels below are told. */
#define COUNT told.n[0]
#define STEP told.n[1]                      /* D */
#define WIDTH told.n[2]
#define HEIGHT told.n[3]
#define COLUMNS told.n[4]                   /* of the field */
#define ROWS told.n[5]
#define SIDE told.n[6]                      /* of its cells; 0 without a field */
#define FIRST_OF told.n[7]                  /* the first density of a plane, or context of the next component */
#define COMPONENT told.n[8]
#define COMPONENTS told.n[9]
#define LAST_OF_GROUP told.n[10]
#define BIT_OF_GROUP told.n[11]
#define MARK told.n[12]                     /* p of new splats */

int3 coded_colors(global const int *codes, int step)
{
    return clamp(vload3(0, codes), -(N_MOST / step), N_MOST / step) * step;
}

int2 log_sizes(global const int *shapes, int j)                     /* A and B of (15-10) */
{
    return clamp((int2)(shapes[0] + shapes[1], shapes[0] - shapes[1]) * (1477 >> j), -3072, 13311);
}

int2 place_steps(int2 sizes, int j)                                 /* g */
{
    return clamp((sizes >> 10) + 1 - j, -4, 2);
}

void intra(global const int *cell, global const int *colors, global const int *shapes, global const int *place, int step,
           global int *state)
{
    int3 n = coded_colors(colors, step);
    int j = main_class(n, step);
    int2 sizes = log_sizes(shapes, j), g = place_steps(sizes, j) + 8;
    int2 position = 1024 * vload2(0, cell) + (vload2(0, place) << g) + ((int2)(1) << (g - 1));
    vstore2(position, 0, state);
    vstore2(sizes, 0, state + 2);
    state[4] = clamp(shapes[2] * (2048 >> j), -32767, 32767);
    vstore3(n, 0, state + 5);
}

kernel void main_main_intra(global const int *cells, global const int *colors, global const int *shapes,
                            global const int *places, global int *state, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT)
        intra(cells + 2 * i, colors + 3 * i, shapes + 3 * i, places + 2 * i, STEP, state + 8 * i);
}

kernel void main_new_splats(global const int *cells, global const int *colors, global const int *shapes,
                            global const int *places, global int *state, global const uint *survivors, global uint *past,
                            Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT) {
        size_t at = survivors[0] + i;
        intra(cells + 2 * i, colors + 3 * i, shapes + 3 * i, places + 2 * i, STEP, state + 8 * at);
        past[at] = MARK;
    }
}

kernel void main_splat_classes(global const int *state, global int *classes, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT)
        classes[i] = main_class(vload3(0, state + 8 * i + 5), STEP);
}

kernel void main_code_classes(global const int *colors, global int *classes, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT)
        classes[i] = main_class(coded_colors(colors + 3 * i, STEP), STEP);
}

kernel void main_window_codes(global const uint *bins, global const uint *low, global const uint *classes,
                              global const Density *densities, global int *codes, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT) {
        Density d = densities[FIRST_OF + classes[i]];
        codes[COMPONENTS * i + COMPONENT] = ((d.first + (int)bins[i]) << d.low_bits) + (int)low[i];
    }
}

kernel void main_place_bits(global const uint *classes, global const int *shapes, global uint *bits, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT) {
        int2 g = place_steps(log_sizes(shapes + 3 * i, classes[i]), classes[i]);
        bits[i] = 2 - (COMPONENT ? g.y : g.x);
    }
}

/* ---- Magnitudes and signs */

uint magnitude_of(uint q, uint low)
{
    return q < 4 ? q : ((2 + q % 2) << bits_of_class(q)) + low;
}

/* What is present of a difference: 0 if it is 0, 1 if it has a sign, 3 if its magnitude is 1 more than what is coded; and the
   contexts of the next component. */
kernel void main_difference_contexts(global const uint *classes, global const uint *modes, global uint *present,
                                     global uint *before, global uint *contexts, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT && (modes[i] & BIT_OF_GROUP)) {
        present[i] = LAST_OF_GROUP && before[i] == 0 ? 3 : min(classes[i], 1u);
        before[i] += classes[i];            /* a class above 3 stands for more than 2 */
        contexts[i] = FIRST_OF + min(before[i], 2u);
    }
}

kernel void main_signed_codes(global const uint *classes, global const uint *low, global const uint *signs,
                              global int *codes, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT) {
        int magnitude = magnitude_of(classes[i], low[i]);
        codes[COMPONENTS * i + COMPONENT] = signs[i] ? -magnitude : magnitude;
    }
}

kernel void main_differences(global const uint *classes, global const uint *low, global const uint *signs,
                             global const uint *present, global int *differences, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT) {
        int magnitude = magnitude_of(classes[i], low[i]) + (present[i] >> 1);
        differences[8 * i + COMPONENT] = signs[i] ? -magnitude : magnitude;
    }
}

/* ---- The motion field (15.10) */

kernel void main_field_contexts(global const uint *classes, global uint *contexts, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT)
        contexts[i] = 1 + (classes[i] > 0) + (classes[i] > 2) + (classes[i] > 7);
}

/* A work-item for each row, which goes down the first column to find where the row begins. */
kernel void main_field_vectors(global const int *steps, global int *vectors, Numbers told)
{
    uint row = get_global_id(0);
    if (row >= ROWS)
        return;
    int2 sum = 0;
    for (uint above = 0; above < row; above++)
        sum += vload2(above * COLUMNS, steps);
    for (uint cell = row * COLUMNS; cell < (row + 1) * COLUMNS; cell++) {
        sum += vload2(cell, steps);
        vstore2(((sum + 32768) & 65535) - 32768, cell, vectors);
    }
}

/* The cell before a position, the one after it, and the 64ths of the way between their centres. */
int3 between(int position, int side, int cells)
{
    int b = 31 - clz(256 * side);
    int u = clamp(position - 128 * side, 0, (cells - 1) << b), i = min(u >> b, max(cells - 2, 0));
    return (int3)(i, min(i + 1, cells - 1), (u - (i << b)) >> (b - 6));
}

kernel void main_motion_of_splats(global const int *state, global const int *vectors, global int *motion, Numbers told)
{
    size_t n = get_global_id(0);
    if (n >= COUNT)
        return;
    int3 x = between(state[8 * n], SIDE, COLUMNS), y = between(state[8 * n + 1], SIDE, ROWS);
    int f = x.z, h = y.z, upper = y.x * COLUMNS, lower = y.y * COLUMNS;
    int2 above = (64 - f) * vload2(upper + x.x, vectors) + f * vload2(upper + x.y, vectors);
    int2 below = (64 - f) * vload2(lower + x.x, vectors) + f * vload2(lower + x.y, vectors);
    vstore2(((64 - h) * above + h * below + 32) >> 6, n, motion);           /* (15-12) */
}

/* ---- P-frames (15.11) */

int distance_of(global const int *vectors, int2 own, int column, int row, Numbers told)
{
    if (column < 0 || column >= COLUMNS || row < 0 || row >= ROWS)
        return 0;
    uint2 d = abs(vload2(row * COLUMNS + column, vectors) - own);
    return d.x + d.y;
}

kernel void main_mode_contexts(global const int *state, global const uint *past, global const int *motion,
                               global const int *vectors, global int *contexts, Numbers told)
{
    size_t n = get_global_id(0);
    if (n >= COUNT)
        return;
    int2 position = vload2(0, state + 8 * n), moved = position + vload2(n, motion);
    int unrest = 0;
    if (SIDE > 0) {
        int b = 31 - clz(256 * SIDE), column = clamp(position.x >> b, 0, COLUMNS - 1), row = clamp(position.y >> b, 0, ROWS - 1);
        int2 own = vload2(row * COLUMNS + column, vectors);
        unrest = max(
            max(distance_of(vectors, own, column - 1, row, told), distance_of(vectors, own, column + 1, row, told)),
            max(distance_of(vectors, own, column, row - 1, told), distance_of(vectors, own, column, row + 1, told)));
    }
    bool outside = moved.x < 0 || moved.x >= 256 * WIDTH || moved.y < 0 || moved.y >= 256 * HEIGHT;
    contexts[n] = outside ? 9 : 3 * past[n] + (unrest > 2) + (unrest > 7);
}

/* (15-13) of a splat that stays. */
void inter(global const uint *tables, global const int *state, global const int *motion, global const int *q, int step,
           global int *after)
{
    int X = state[0], Y = state[1], A = state[2], B = state[3], S = state[4], sign_of_S = (S > 0) - (S < 0);
    int3 n = vload3(0, state + 5);
    int j = main_class(n, step), h = 1477 >> j;
    int g_x = clamp(main_exp2(tables, A + 512 - 1024 * j, 8), 1, STEP_MOST);
    int g_y = clamp(main_exp2(tables, B + 512 - 1024 * j, 8), 1, STEP_MOST);
    int g_s = sign_of_S * (int)min((uint)abs(S) * (uint)g_y >> 10, (uint)STEP_MOST);
    int new_A = clamp(A + (q[2] + q[3]) * h, -3072, 13311), new_B = clamp(B + (q[2] - q[3]) * h, -3072, 13311);
    int v = (new_A - A) - (new_B - B), shift = min(15 - (v >> 10), 31);
    uint product = abs(S) * tables[v & 1023];                       /* what is shifted to the left is above the range, or 0 */
    int sheared = sign_of_S * (shift > 0 ? (int)min(product >> shift, 32767u) : 32767);
    after[0] = clamp(X + motion[0] + q[0] * g_x, -(1 << 24), 1 << 24);
    after[1] = clamp(Y + motion[1] + q[0] * g_s + q[1] * g_y, -(1 << 24), 1 << 24);
    after[2] = new_A;
    after[3] = new_B;
    after[4] = clamp(sheared + q[4] * (2048 >> j), -32767, 32767);
    vstore3(clamp(n + vload3(0, q + 5) * step, -N_MOST, N_MOST), 0, after + 5);
}

kernel void main_main_inter(global const uint *tables, global const int *state, global const int *motion,
                            global const int *differences, global int *after, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT)
        inter(tables, state + 8 * i, motion + 2 * i, differences + 8 * i, STEP, after + 8 * i);
}

/* The same for the splats of a list. */
kernel void main_stay(global const uint *tables, global const int *state, global const int *motion,
                      global const int *differences, global const uint *list, global int *after, global const uint *modes,
                      global uint *past, Numbers told)
{
    size_t at = get_global_id(0);
    if (at < list[0]) {
        size_t i = list[1 + at];
        inter(tables, state + 8 * i, motion + 2 * i, differences + 8 * i, STEP, after + 8 * at);
        past[at] = min(modes[i], 1u);
    }
}

/* ---- Parameters (15-5) as bit patterns, and work (5-2): no floating point */

uint digits(uint p)
{
    return 32 - clz(p);
}

/* sign q 2^(e + k) with (q, e) = r24(p). No number here is subnormal or beyond binary32. */
uint pattern(int sign_of, uint p, int k)
{
    uint e = max((int)digits(p) - 24, 0);
    uint q = e > 0 ? (p + (1u << (e - 1)) - 1 + (p >> e & 1)) >> e : p, z = digits(q);    /* 25 if q is 2^24 */
    uint fraction = z > 24 ? 0 : q << (24 - z) & 0x7FFFFF;
    return q == 0 ? 0 : (sign_of < 0 ? 0x80000000 : 0) | (uint)(k + (int)(e + z) + 126) << 23 | fraction;
}

uint weighted(int t, uint G, int k)
{
    uint magnitude = abs(t);
    return pattern(t, (magnitude >> 15) * G + ((magnitude & 0x7FFF) * G >> 15), k);
}

kernel void main_state_parameters(global const uint *tables, global const int *state, global uint *parameters, Numbers told)
{
    size_t i = get_global_id(0);
    if (i >= COUNT)
        return;
    int8 t = vload8(i, state);
    uint4 magnitudes = (uint4)(abs(t.s567), 0);
    int s = max((int)digits(max(max(magnitudes.x, magnitudes.y), magnitudes.z)) - 14, 0), v = -(t.s2 + t.s3) >> 1;
    int3 k = (int3)(42862, 52495, 30308), P = (t.s567 >> s) * k + ((t.s567 & ((1 << s) - 1)) * k >> s);
    uint G = tables[v & 1023], of_A = tables[t.s2 & 1023], of_B = tables[t.s3 & 1023];
    int of_color = s + (v >> 10) - 29;
    uint8 found = (uint8)(
        pattern(t.s0, abs(t.s0), -8),
        pattern(t.s1, abs(t.s1), -8),
        pattern(1, of_A, (t.s2 >> 10) - 15),
        pattern(t.s4, abs(t.s4) * of_B, (t.s3 >> 10) - 25),
        pattern(1, of_B, (t.s3 >> 10) - 15),
        weighted(P.x + P.y + P.z, G, of_color),
        weighted(P.x - 2 * P.z, G, of_color),
        weighted(P.x - P.y + P.z, G, of_color));
    vstore8(found, i, parameters);
}

int reach_of(global const uint *tables, int v)                      /* E_x from A, or e from B */
{
    return (int)(tables[v & 1023] * 54544 >> (21 - (v >> 10))) + 1;
}

uint side_of(int middle, int reach, int size, uint h)
{
    const int filters[4] = {0, 427, 953, 1953};
    int far = reach + filters[h], end = min((size + (1 << h) - 1) >> h, (middle + far + (256 << h) - 1) >> (8 + h));
    return max(0, end - max(0, (middle - far) >> (8 + h)));
}

kernel void main_main_work(global const uint *tables, global const int *state, global uint *work, Numbers told)
{
    size_t i = get_global_id(0);
    if (i >= COUNT)
        return;
    int8 t = vload8(i, state);
    int m = 1024 + abs(t.s4), e = reach_of(tables, t.s3), e_y = (e >> 10) * m + ((e & 1023) * m >> 10) + 1;
    uint h = told.n[3];
    work[i] = side_of(t.s0, reach_of(tables, t.s2), told.n[1], h) * side_of(t.s1, e_y, told.n[2], h);
}

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

/* The cell of each splat: that of the last part that does not begin behind it. */
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

/* The magnitudes of a component of the differences, and the contexts of the next one. */
kernel void main_magnitudes(global const uint *classes, global const uint *low, global const uint *modes,
                            global uint *magnitudes, global uint *before, global uint *contexts, Numbers told)
{
    size_t i = get_global_id(0);
    if (i < COUNT && (modes[i] & BIT_OF_GROUP)) {
        uint magnitude = magnitude_of(classes[i], low[i]) + (LAST_OF_GROUP && before[i] == 0);
        magnitudes[COMPONENTS * i + COMPONENT] = magnitude;
        before[i] += magnitude;
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

kernel void main_differences(global const int *magnitudes, global const uint *signs, global int *differences, Numbers told)
{
    size_t at = get_global_id(0);
    if (at < 8 * (size_t)COUNT)
        differences[at] = signs[at] ? -magnitudes[at] : magnitudes[at];
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

/* The cell before a position, the one behind it, and the 64ths of the way between their centres. */
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
    int g_s = sign_of_S * (int)min((long)abs(S) * g_y >> 10, (long)STEP_MOST);
    int new_A = clamp(A + (q[2] + q[3]) * h, -3072, 13311), new_B = clamp(B + (q[2] - q[3]) * h, -3072, 13311);
    int v = (new_A - A) - (new_B - B), shift = clamp(15 - (v >> 10), -16, 63);
    long product = (long)abs(S) * tables[v & 1023];
    int sheared = sign_of_S * (int)min(shift < 0 ? product << -shift : product >> shift, (long)32767);
    after[0] = clamp(X + motion[0] + q[0] * g_x, -(1 << 25), 1 << 25);
    after[1] = clamp(Y + motion[1] + q[0] * g_s + q[1] * g_y, -(1 << 25), 1 << 25);
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

/* ---- Parameters (15-5), exact */

float power_of_two(global const uint *tables, int v)
{
    return ldexp((float)tables[v & 1023], (v >> 10) - 15);
}

kernel void main_state_parameters(global const uint *tables, global const int *state, global float *parameters, Numbers told)
{
    size_t i = get_global_id(0);
    if (i >= COUNT)
        return;
    state += 8 * i;
    parameters += 8 * i;
    float l22 = power_of_two(tables, state[3]), g = power_of_two(tables, -(state[2] + state[3]) >> 1);
    float a = (float)state[5] * 0x1.4edc56p-14f, b = (float)state[6] * 0x1.9a1e72p-14f, c = (float)state[7] * 0x1.d99086p-15f;
    parameters[0] = (float)state[0] * 0x1p-8f;
    parameters[1] = (float)state[1] * 0x1p-8f;
    parameters[2] = power_of_two(tables, state[2]);
    parameters[3] = (float)state[4] * 0x1p-10f * l22;
    parameters[4] = l22;
    parameters[5] = (a + b + c) * g;
    parameters[6] = (a - 2 * c) * g;
    parameters[7] = (a - b + c) * g;
}

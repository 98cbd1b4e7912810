/* Profile main: its operations one by one (spec.md 4.3), by the functions that read_body uses. What they are told stands in
   `told.n`, in the order of adapters/main_operations.py. */

#include "main_parts.cuh"
#include "main_run.cuh"
#include "main_splats.cuh"

struct Numbers {
    int n[24];
};

/* What window_frequencies and half_frequencies say besides frequencies, as main_operations.py has it. */
struct Density {
    int unused[4];
    int first, edges[2];
    unsigned bins, low_bits;
};

extern "C" __global__ void density_frequencies(const Tables *tables, const int *edges, unsigned *result, Numbers told)
{
    unsigned i = thread_of_grid(), bins = told.n[0];
    Distribution d = {nullptr, bins, 0, 0, told.n[2], (unsigned)told.n[3], (unsigned)told.n[4], (unsigned)told.n[5]};
    if (i <= bins)
        result[i] = i == 0 || i == bins ? i / bins * TOTAL : density_at(*tables, d, i, edges[i - 1]);
}

static __device__ void show(const Tables &tables, const Distribution &d, int first, unsigned low_bits, unsigned *result,
                            Density *density)
{
    unsigned i = thread_of_grid();
    if (i <= d.bins)
        result[i] = cumulative_at(tables, d, i);
    if (i == 0)
        *density = {{}, first, {}, d.bins, low_bits};
}

extern "C" __global__ void window_frequencies(const Tables *tables, unsigned *result, Density *density, Numbers told)
{
    Window window = window_density(*tables, told.n[2], told.n[1], told.n[3], told.n[4]);
    show(*tables, window.bins, window.first, window.low_bits, result, density);
}

extern "C" __global__ void half_frequencies(const Tables *tables, unsigned *result, Density *density, Numbers told)
{
    Distribution d = half_density(*tables, told.n[0], told.n[6], told.n[7], told.n[8]);
    show(*tables, d, 0, low_bits_of_half(told.n[0]), result, density);
}

extern "C" __global__ void model_frequencies(const unsigned *counts, unsigned *result, Numbers told)
{
    unsigned context = thread_of_grid(), symbols = told.n[1];
    if (context < told.n[0])
        context_frequencies(counts + context * symbols, symbols, result + context * (symbols + 1));
}

extern "C" __global__ void adapt_model(const unsigned *counts, unsigned *result, const unsigned *seen, Numbers told)
{
    unsigned context = thread_of_grid(), symbols = told.n[1], first = context * symbols;
    if (context < told.n[0])
        adapt_context(counts + first, seen + first, symbols, result + first);
}

/* (7-2): each lane goes through the symbols backwards and takes those of its own. */
extern "C" __global__ void encode(const unsigned *starts, const unsigned *frequencies, const unsigned *lanes, unsigned *states,
                                  unsigned *emitted, Numbers told)
{
    unsigned lane = thread_of_grid();
    if (lane >= told.n[3])
        return;
    unsigned x = states[lane];
    for (int k = 0; k < told.n[2]; k++) {
        unsigned i = told.n[1] - k, f = frequencies[i];
        if (lanes[i] != lane)
            continue;
        if (x >> 18 >= f) {                 /* x >= f << 18; once is enough */
            emitted[i] = 0x10000 | (x & 0xFFFF);
            x >>= 16;
        }
        x = (x / f << 14) + x % f + starts[i];
    }
    states[lane] = x;
}

extern "C" __global__ void signed_codes(const unsigned *classes, const unsigned *low, const unsigned *negative, int *codes,
                                        Numbers told)
{
    unsigned i = thread_of_grid();
    if (i < told.n[0])
        codes[i] = magnitude_of(classes[i], low[i]) * (negative[i] ? -1 : 1);
}

/* One block. The parts of all halvings have a number in `first_halves`, one after the other. */
extern "C" __global__ void cells_of_halves(const unsigned *first_halves, int width, int height, unsigned count, Part *parts,
                                           Part *other, unsigned *packed, int2 *cells)
{
    unsigned halvings = halving_count(width, height), there = 1;
    if (threadIdx.x == 0)
        parts[0] = {0, count};
    __syncthreads();
    for (unsigned halving = 0; halving < halvings; halving++) {
        int axis = halving % 2, inside = cells_inside(width, height, axis);
        unsigned asked = there;
        there = split_parts(halving % 2 ? other : parts, there, axis, half_size(halvings, halving), inside,
                            halving % 2 ? parts : other, [&](unsigned n) { return first_halves[n]; });
        first_halves += asked;
    }
    locate_splats(parts, there, packed);
    for (unsigned n = threadIdx.x; n < count; n += blockDim.x)
        cells[n] = make_int2(packed[n] & 0xFFFF, packed[n] >> 16);
}

/* One block, whatever the grid: the vectors take the place of the differences. */
extern "C" __global__ void field_vectors(const int2 *differences, int2 *vectors, Numbers told)
{
    int columns = told.n[4], rows = told.n[5];
    if (blockIdx.x > 0)
        return;
    for (int cell = threadIdx.x; cell < columns * rows; cell += blockDim.x)
        vectors[cell] = differences[cell];
    __syncthreads();
    add_up_vectors(vectors, columns, rows);
}

extern "C" __global__ void splat_classes(const State *states, int *classes, Numbers told)
{
    unsigned n = thread_of_grid();
    if (n < told.n[0])
        classes[n] = splat_class(states[n].n, told.n[1]);
}

extern "C" __global__ void main_intra(const int *cells, const int *colors, const int *shapes, const int *places, State *states,
                                      Numbers told)
{
    unsigned n = thread_of_grid();
    if (n < told.n[0])
        states[n] = intra_state(cells + 2 * n, colors + 3 * n, shapes + 3 * n, places + 2 * n, told.n[1]);
}

extern "C" __global__ void motion_of_splats(const State *states, const int2 *vectors, int2 *motion, Numbers told)
{
    unsigned n = thread_of_grid();
    if (n < told.n[0])
        motion[n] = motion_of_splat(states[n], {told.n[6], told.n[4], told.n[5], vectors});
}

extern "C" __global__ void mode_contexts(const State *states, const unsigned *past, const int2 *motion, const int2 *vectors,
                                         int *contexts, Numbers told)
{
    unsigned n = thread_of_grid();
    Field field = {told.n[6], told.n[4], told.n[5], vectors};
    if (n < told.n[0])
        contexts[n] = mode_context(states[n], past[n], motion[n], field, told.n[2], told.n[3]);
}

extern "C" __global__ void main_inter(const Tables *tables, const State *states, const int2 *motion, const int *differences,
                                      State *after, Numbers told)
{
    unsigned n = thread_of_grid();
    if (n < told.n[0])
        after[n] = inter_state(*tables, states[n], motion[n], differences + 8 * n, told.n[1]);
}

/* A layer without a chunk, whose splats move by the field of the base: X and Y are clipped (15.13). */
extern "C" __global__ void carry(const State *states, const int2 *vectors, State *after, Numbers told)
{
    unsigned n = thread_of_grid();
    if (n >= told.n[0])
        return;
    State moved = states[n];
    int2 motion = motion_of_splat(moved, {told.n[6], told.n[4], told.n[5], vectors});
    moved.X += motion.x;
    moved.Y += motion.y;
    after[n] = clipped_state(moved);
}

extern "C" __global__ void main_work(const Tables *tables, const State *states, unsigned *work, Numbers told)
{
    unsigned n = thread_of_grid();
    if (n < told.n[0])
        work[n] = work_of(*tables, states[n], told.n[1], told.n[2], told.n[3]);
}

extern "C" __global__ void state_parameters(const Tables *tables, const State *states, unsigned *parameters, Numbers told)
{
    unsigned n = thread_of_grid();
    if (n < told.n[0])
        parameters_of(*tables, states[n], parameters + 8 * n);
}

/* The parameters of a frame; what is behind the last splat, up to `most`, is no splat (9.1). */
extern "C" __global__ void frame_parameters(const Tables *tables, const State *states, const unsigned *count, unsigned most,
                                            unsigned *parameters)
{
    unsigned n = thread_of_grid();
    if (n < *count)
        parameters_of(*tables, states[n], parameters + 8 * n);
    else if (n < most)
        for (int column = 0; column < 8; column++)
            parameters[8 * n + column] = 0;
}

/* Profile main: what a block makes of cells, of new splats (spec.md 15.8) and of the motion field (15.10). */

#pragma once

#include "blocks.cuh"
#include "main_tables.cuh"

struct Part {
    unsigned cell, splats;                  /* of its first cell the column, and the row in the upper 16 bits */
};

/* Cells of a second half that are inside of the frame. */
static __device__ __forceinline__ int second_half(const Part &part, int axis, int size, int inside)
{
    return min(size, inside - (int)(axis ? part.cell >> 16 : part.cell & 0xFFFF) - size);
}

static __device__ __forceinline__ int cells_inside(int width, int height, int axis)
{
    return ((axis ? height : width) + 3) / 4;
}

static __device__ unsigned halving_count(int width, int height)
{
    return 2 * bit_length(max(cells_inside(width, height, 0), cells_inside(width, height, 1)) - 1);
}

/* Side of a first half in cells. */
static __device__ __forceinline__ int half_size(unsigned halvings, unsigned halving)
{
    return 1 << (halvings / 2 - 1 - halving / 2);
}

/* Each part becomes two, of which `first(n)` is in the first one; those without splats go. How many there are then. */
template <class First>
__device__ unsigned split_parts(const Part *parts, unsigned count, int axis, int size, int inside, Part *halves, First first)
{
    Share own = share_of(count);
    unsigned there = 0;
    ROLLED for (unsigned n = own.first; n < own.end; n++) {
        unsigned k = second_half(parts[n], axis, size, inside) > 0 ? min(first(n), parts[n].splats) : parts[n].splats;
        there += (k > 0) + (k < parts[n].splats);
    }
    uint2 found = sum_before(there);
    ROLLED for (unsigned n = own.first; n < own.end; n++) {
        Part part = parts[n];
        unsigned k = second_half(part, axis, size, inside) > 0 ? min(first(n), part.splats) : part.splats;
        if (k > 0)
            halves[found.x++] = {part.cell, k};
        if (k < part.splats)
            halves[found.x++] = {part.cell + (axis ? size << 16 : size), part.splats - k};
    }
    __syncthreads();
    return found.y;
}

/* The cell of each splat; a part has its splats side by side. */
static __device__ void locate_splats(const Part *parts, unsigned count, unsigned *cells)
{
    Share own = share_of(count);
    unsigned splats = 0;
    ROLLED for (unsigned n = own.first; n < own.end; n++)
        splats += parts[n].splats;
    unsigned at = sum_before(splats).x;
    ROLLED for (unsigned n = own.first; n < own.end; n++)
        ROLLED for (unsigned k = 0; k < parts[n].splats; k++)
            cells[at++] = parts[n].cell;
    __syncthreads();
}

/* ---- The motion field */

/* Sums modulo 2^16: down the first column, by a thread, then along each row, by a thread for a row. */
static __device__ void add_up_vectors(int2 *vectors, int columns, int rows)
{
    if (threadIdx.x == 0)
        ROLLED for (int row = 1; row < rows; row++) {
            int2 &vector = vectors[row * columns], above = vectors[(row - 1) * columns];
            vector = make_int2(vector.x + above.x, vector.y + above.y);
        }
    __syncthreads();
    in_turn(rows, [&](unsigned row) {
        int2 sum = make_int2(0, 0);
        ROLLED for (int cell = row * columns; cell < (row + 1) * columns; cell++) {
            sum = make_int2(sum.x + vectors[cell].x, sum.y + vectors[cell].y);
            vectors[cell] = make_int2(((sum.x + 32768) & 65535) - 32768, ((sum.y + 32768) & 65535) - 32768);
        }
    });
    __syncthreads();
}

/* Which splats touch which region of the frame: no sort, and no order in which atomics happen matters. */

#include "splats.cuh"

#define SPLATS_OF_BLOCK 8

/* One warp for each splat: it looks at the regions of the splat's box and sets its bit in the lists of those that it touches.
   `lists` comes as zeros. A splat has a slot for each block of its box, if there is room for all of them in `slots`;
   `slots_needed`, which comes as zero, says how many there should be. Which splat has which is open. */
extern "C" __global__ void __launch_bounds__(32 * SPLATS_OF_BLOCK)
list_intersections(const float *parameters, int splat_count, int width, int height, int side, int columns, int list_size,
                   Splat *splats, unsigned *lists, int slots, unsigned long long *slots_needed)
{
    int n = blockIdx.x * SPLATS_OF_BLOCK + threadIdx.x / 32, lane = threadIdx.x % 32;
    if (n >= splat_count)
        return;
    parameters += 8 * (size_t)n;
    Splat s = project(parameters);
    Box box = is_drawn(parameters) ? box_of(s, side, width, height) : Box{0, 0, 0, 0};
    if (lane == 0) {
        if (slots > 0 && is_drawn(parameters)) {
            Box blocks = box_of(s, BLOCK, width, height);
            unsigned long long needed = (unsigned long long)blocks.columns * blocks.rows;
            unsigned long long first = atomicAdd(slots_needed, needed);
            s.slot = first + needed <= slots ? (int)first : -1;
        }
        splats[n] = s;
    }
    for (int k = lane; k < box.columns * box.rows; k += 32) {
        int column = box.left + k % box.columns, row = box.top + k / box.columns;
        float left = column * side + 0.5f, right = min((column + 1) * side, width) - 0.5f;
        float top = row * side + 0.5f, bottom = min((row + 1) * side, height) - 0.5f;
        size_t region = (size_t)row * columns + column;
        if (touches(s, left, right, top, bottom))
            atomicOr(lists + region * list_size * 4 + n / 32, 1u << n % 32);
    }
}

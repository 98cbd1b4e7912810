/* Which splats touch which region of the frame: no sort, and no order in which atomics happen matters. */

#include "splats.cuh"

#define SPLATS_OF_BLOCK 8

/* The first of the slots that each warp asks for, -1 if there is no room for them. One atomic addition for the whole block:
   all blocks want the same number. */
static __device__ __forceinline__ int take_slots(int wanted, int slots, unsigned long long *slots_needed)
{
    __shared__ unsigned long long first;
    int total, before = sum_before<SPLATS_OF_BLOCK>(threadIdx.x % 32 == 0 ? wanted : 0, &total);
    if (threadIdx.x == 0)
        first = atomicAdd(slots_needed, (unsigned long long)total);
    __syncthreads();
    before = __shfl_sync(EVERY_LANE, before, 0);
    return first + before + wanted <= slots ? (int)(first + before) : -1;
}

/* One warp for each splat: it looks at the regions of the splat's box and sets its bit in the lists of those that it touches.
   `lists` comes as zeros. If there are to be slots, a splat has one for each block of its box, and which is open;
   `slots_needed`, which comes as zero, says how many there should be. */
extern "C" __global__ void __launch_bounds__(32 * SPLATS_OF_BLOCK)
list_intersections(const float *parameters, int splat_count, int width, int height, int side, int columns, int list_size,
                   Splat *splats, unsigned *lists, int slots, unsigned long long *slots_needed)
{
    int n = blockIdx.x * SPLATS_OF_BLOCK + threadIdx.x / 32, lane = threadIdx.x % 32;
    bool drawn = n < splat_count && is_drawn(parameters + 8 * (size_t)n);
    Splat s = project(parameters + 8 * (size_t)min(n, splat_count - 1));
    Box box = drawn ? box_of(s, side, width, height) : Box{0, 0, 0, 0};
    if (slots > 0) {
        Box blocks = drawn ? box_of(s, BLOCK, width, height) : Box{0, 0, 0, 0};
        s.slot = take_slots(blocks.columns * blocks.rows, slots, slots_needed);
    }
    if (lane == 0 && n < splat_count)
        splats[n] = s;
    for (int k = lane; k < box.columns * box.rows; k += 32) {
        int column = box.left + k % box.columns, row = box.top + k / box.columns;
        float left = column * side + 0.5f, right = min((column + 1) * side, width) - 0.5f;
        float top = row * side + 0.5f, bottom = min((row + 1) * side, height) - 0.5f;
        size_t region = (size_t)row * columns + column;
        if (touches(s, left, right, top, bottom))
            atomicOr(lists + region * list_size * 4 + n / 32, 1u << n % 32);
    }
}

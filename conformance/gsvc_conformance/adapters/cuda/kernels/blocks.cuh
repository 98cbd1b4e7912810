/* What the threads of a block do together. A block has a whole number of warps. */

#pragma once

#include "common.cuh"

/* In front of a loop that is not to be unrolled: most of what a block does alone it does once, and longer code takes longer
   to fetch. */
#define ROLLED _Pragma("unroll 1")

/* Items of a thread, where each has a run of items that follow one another. */
struct Share {
    unsigned first, end;
};

static __device__ __forceinline__ Share share_of(unsigned count)
{
    unsigned each = (count + blockDim.x - 1) / blockDim.x, first = min(count, threadIdx.x * each);
    return {first, min(count, first + each)};
}

/* work(i) for each item, by one thread after the other. */
template <class Work> __device__ void in_turn(unsigned count, Work work)
{
    ROLLED for (unsigned i = threadIdx.x; i < count; i += blockDim.x)
        work(i);
}

/* The sum of a number over the threads before this one, and over all of them, whatever the size of the block. All threads
   have to come here. */
static __device__ __noinline__ uint2 sum_before(unsigned value)
{
    __shared__ unsigned of_warps[32];
    unsigned lane = threadIdx.x % 32, warp = threadIdx.x / 32, inclusive = value;
    ROLLED for (unsigned step = 1; step < 32; step *= 2) {
        unsigned lower = __shfl_up_sync(EVERY_LANE, inclusive, step);
        inclusive += lane >= step ? lower : 0;
    }
    __syncthreads();                        /* the numbers of the sum before have been read */
    if (lane == 31)
        of_warps[warp] = inclusive;
    __syncthreads();
    uint2 found = make_uint2(inclusive - value, 0);
    ROLLED for (unsigned other = 0; other < blockDim.x / 32; other++) {
        found.x += other < warp ? of_warps[other] : 0;
        found.y += of_warps[other];
    }
    return found;
}

/* The items for which `take(i)` is true, in their order; how many they are. Nobody may read the list before a barrier. */
template <class Take> __device__ unsigned choose(unsigned count, unsigned *list, Take take)
{
    Share own = share_of(count);
    unsigned chosen = 0;
    ROLLED for (unsigned i = own.first; i < own.end; i++)
        chosen += take(i);
    uint2 found = sum_before(chosen);
    ROLLED for (unsigned i = own.first; i < own.end; i++)
        if (take(i))
            list[found.x++] = i;
    return found.y;
}

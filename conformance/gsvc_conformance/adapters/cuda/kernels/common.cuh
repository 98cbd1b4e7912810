/* What every file of kernels begins with.

   Each file is compiled twice, for speed and with EXACT for identical bytes (spec.md 3.3, 9.3). What must be rounded by
   itself is written with __fmul_rn and its like, which no compiler fuses; subnormal numbers are never flushed, but for
   what says so. There are no atomic additions of float, since those of a GPU flush: sums over blocks go through memory in
   a fixed order. */

#pragma once

#ifdef FIBERS
#include "fibers.h"
#endif

#ifdef __CUDACC_RTC__                       /* NVRTC has no headers */
#define INFINITY __int_as_float(0x7f800000)
#define NAN __int_as_float(0x7fffffff)
#endif

#define EVERY_LANE 0xffffffffu

static __device__ __forceinline__ int thread_of_grid() { return blockIdx.x * blockDim.x + threadIdx.x; }

/* a b + c: two roundings for identical bytes, else one or two as the compiler likes. */
static __device__ __forceinline__ float multiply_add(float a, float b, float c)
{
#ifdef EXACT
    return __fadd_rn(__fmul_rn(a, b), c);
#else
    return a * b + c;
#endif
}

/* The sum of a block's values before this thread's, in the order of threads, and that of all. */
template <int WARPS, class T> static __device__ __forceinline__ T sum_before(T value, T *total)
{
    __shared__ T of_warp[WARPS];
    int lane = threadIdx.x % 32, warp = threadIdx.x / 32;
    T through = value;
    for (int step = 1; step < 32; step *= 2) {
        T before = __shfl_up_sync(EVERY_LANE, through, step);
        through += lane >= step ? before : 0;
    }
    if (lane == 31)
        of_warp[warp] = through;
    __syncthreads();
    T before = 0, all = 0;
    for (int other = 0; other < WARPS; other++) {
        before += other < warp ? of_warp[other] : 0;
        all += of_warp[other];
    }
    __syncthreads();
    *total = all;
    return before + through - value;
}

/* The sum of a block's values, in a fixed order; every thread gets it. */
template <int WARPS, class T> static __device__ __forceinline__ T sum_of_block(T value)
{
    __shared__ T of_warp[WARPS];
    for (int across = 16; across > 0; across /= 2)
        value += __shfl_xor_sync(EVERY_LANE, value, across);
    if (threadIdx.x % 32 == 0)
        of_warp[threadIdx.x / 32] = value;
    __syncthreads();
    T sum = 0;
    for (int warp = 0; warp < WARPS; warp++)
        sum += of_warp[warp];
    __syncthreads();
    return sum;
}

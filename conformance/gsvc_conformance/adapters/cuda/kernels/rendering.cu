/* From sums of pixels to samples. */

#include "common.cuh"

/* One thread for each sample: (9-7), which bounded rendering may use as well. Both comparisons fail for a NaN: black. */
extern "C" __global__ void to_frame(const float *sum, long long samples, int bit_depth, unsigned char *frame)
{
    long long at = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (at >= samples)
        return;
    float v = sum[at] > 0 ? sum[at] : 0.0f;
    v = sum[at] >= 1 ? 1.0f : v;
    int sample = __float2int_rn(__fmul_rn(v, (float)((1 << bit_depth) - 1)));
    if (bit_depth == 8)
        frame[at] = (unsigned char)sample;
    else
        ((unsigned short *)frame)[at] = (unsigned short)sample;
}

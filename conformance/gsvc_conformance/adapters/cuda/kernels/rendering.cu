/* From splats to sums of pixels, and from sums to samples. */

#define ROWS 4
#include "sums.cuh"

/* (9-7) and R-9.1-1. Both comparisons fail for a NaN: black. */
static __device__ __forceinline__ int sample_of(float sum, int peak)
{
    float v = sum > 0 ? sum : 0.0f;
    v = sum >= 1 ? 1.0f : v;
    return __float2int_rn(__fmul_rn(v, (float)peak));
}

/* `base` may be null. */
extern "C" __global__ void __launch_bounds__(THREADS, 5) render_sum(Scene scene, const float *base, float *sum)
{
    Tile tile = tile_of_warp(scene);
    write_pixels(scene, tile, sums_of(scene, tile, base), sum);
}

extern "C" __global__ void __launch_bounds__(THREADS, 5) render_frame(Scene scene, int bit_depth, unsigned char *frame)
{
    Tile tile = tile_of_warp(scene);
    Sums sums = sums_of(scene, tile, nullptr);
    auto sample = [=](float sum) { return sample_of(sum, (1 << bit_depth) - 1); };
    if (bit_depth == 8)
        write_pixels(scene, tile, sums, frame, sample);
    else
        write_pixels(scene, tile, sums, (unsigned short *)frame, sample);
}

/* One thread for each sample of a sum that is there already. */
extern "C" __global__ void to_frame(const float *sum, long long samples, int bit_depth, unsigned char *frame)
{
    long long at = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (at >= samples)
        return;
    int sample = sample_of(sum[at], (1 << bit_depth) - 1);
    if (bit_depth == 8)
        frame[at] = (unsigned char)sample;
    else
        ((unsigned short *)frame)[at] = (unsigned short)sample;
}

/* (9-8), one thread for each splat. */
extern "C" __global__ void scale_parameters(const float *parameters, int splat_count, float width, float height,
                                            float new_width, float new_height, float *scaled)
{
    int n = thread_of_grid();
    if (n >= splat_count)
        return;
    float a = __fdiv_rn(new_width, width), e = __fdiv_rn(new_height, height);
    const float factors[8] = {a, e, a, e, e, 1, 1, 1};
    for (int column = 0; column < 8; column++)
        scaled[8 * (size_t)n + column] = __fmul_rn(parameters[8 * (size_t)n + column], factors[column]);
}

/* The root of p^2 + q^2, p > 0, whose squares may leave the range of binary32. */
static __device__ __forceinline__ float hypotenuse(float p, float q)
{
    float larger = fmaxf(p, fabsf(q)), ratio = fminf(p, fabsf(q)) / larger;
    return larger * __fsqrt_rn(1 + ratio * ratio);
}

/* (9-9), one thread for each splat. The roots of v_x and v_y come from the host, 0 for a side that is not made smaller. */
extern "C" __global__ void scale_parameters_filtered(const float *parameters, int splat_count, float a, float e, float h_x,
                                                     float h_y, float *filtered)
{
    int n = thread_of_grid();
    if (n >= splat_count)
        return;
    const float *p = parameters + 8 * (size_t)n;
    float *scaled = filtered + 8 * (size_t)n;
    float l11 = p[2] * a, l21 = p[3] * e, l22 = p[4] * e, color = 1;
    if (p[2] >= SMALLEST_NORMAL && p[4] >= SMALLEST_NORMAL) {   /* R-9.4-3 */
        float m11 = h_x > 0 ? hypotenuse(l11, h_x) : l11;
        float m22 = h_y > 0 ? hypotenuse(l22, h_y) : l22;
        if (h_x > 0)
            m22 = hypotenuse(m22, l21 * (h_x / m11));
        float across = h_x > 0 ? l11 / m11 : 1.0f;
        color = across * (l22 / m22);
        l11 = m11;
        l21 *= across;
        l22 = m22;
    }
    scaled[0] = p[0] * a;
    scaled[1] = p[1] * e;
    scaled[2] = l11;
    scaled[3] = l21;
    scaled[4] = l22;
    for (int column = 5; column < 8; column++)
        scaled[column] = p[column] * color;
}

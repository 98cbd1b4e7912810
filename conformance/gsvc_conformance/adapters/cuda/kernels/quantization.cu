/* Quantisation in training: LSQ+ (10.5), residual vectors, and how their codebooks follow what uses them (10.6). */

#include "common.cuh"

#define WARPS 8
#define THREADS (32 * WARPS)

/* t of (10-15). Two roundings, and a decision follows: exact, or codes flip. */
static __device__ __forceinline__ float lsq_ratio(float x, float scale, float offset)
{
    return __fdiv_rn(__fsub_rn(x, offset), scale);
}

/* (10-16), one thread for each value. */
extern "C" __global__ void lsq_quantize(const float *x, const float *scale, const float *offset, int channels, float largest,
                                        long long count, unsigned short *codes)
{
    long long at = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (at < count) {
        float t = lsq_ratio(x[at], scale[at % channels], offset[at % channels]);
        codes[at] = (unsigned short)__float2int_rn(fminf(fmaxf(t, 0.0f), largest));
    }
}

/* (10-17), one thread for each code. */
extern "C" __global__ void lsq_dequantize(const unsigned short *codes, const float *scale, const float *offset, int channels,
                                          long long count, float *values)
{
    long long at = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (at < count)
        values[at] = __fadd_rn(__fmul_rn(codes[at], scale[at % channels]), offset[at % channels]);
}

/* (10-18) and (10-19), one block for each channel: its threads go through the splats. */
extern "C" __global__ void __launch_bounds__(THREADS)
lsq_gradients(const float *x, const float *scale, const float *offset, float largest, const float *grad_output, int rows,
              int channels, float *grad_x, float *grad_scale, float *grad_offset)
{
    int channel = blockIdx.x;
    double of_scale = 0, of_offset = 0;
    for (size_t row = threadIdx.x; row < (size_t)rows; row += THREADS) {
        size_t at = row * channels + channel;
        float t = lsq_ratio(x[at], scale[channel], offset[channel]), grad = grad_output[at];
        bool inside = t >= 0 && t <= largest;           /* the ends are inside */
        grad_x[at] = inside ? grad : 0.0f;
        of_scale += inside ? grad * (rintf(t) - t) : t > largest ? grad * largest : 0.0f;
        of_offset += inside ? 0.0f : grad;
    }
    double scale_sum = sum_of_block<WARPS>(of_scale), offset_sum = sum_of_block<WARPS>(of_offset);
    if (threadIdx.x == 0) {
        grad_scale[channel] = (float)scale_sum;
        grad_offset[channel] = (float)offset_sum;
    }
}

static __device__ __forceinline__ float3 read_vector(const float *vectors, size_t n)
{
    return make_float3(vectors[3 * n], vectors[3 * n + 1], vectors[3 * n + 2]);
}

static __device__ __forceinline__ void write_vector(float *vectors, size_t n, float3 vector)
{
    vectors[3 * n] = vector.x;
    vectors[3 * n + 1] = vector.y;
    vectors[3 * n + 2] = vector.z;
}

static __device__ __forceinline__ float3 difference(float3 a, float3 b)
{
    return make_float3(__fsub_rn(a.x, b.x), __fsub_rn(a.y, b.y), __fsub_rn(a.z, b.z));
}

/* fl(fl(e0^2 + e1^2) + e2^2), each square rounded. */
static __device__ __forceinline__ float square(float3 e)
{
    return __fadd_rn(__fadd_rn(__fmul_rn(e.x, e.x), __fmul_rn(e.y, e.y)), __fmul_rn(e.z, e.z));
}

/* (10-20), one thread for each vector. Codewords are taken in ascending order and only a smaller distance replaces the best:
   the least index where distances are equal. The codewords of stage k are first[k] to first[k + 1] - 1. */
extern "C" __global__ void rvq_assign(const float *x, const int *first, const float *codebooks, int stages, int count,
                                      unsigned short *indices)
{
    int n = thread_of_grid();
    if (n >= count)
        return;
    float3 r = read_vector(x, n);
    for (int k = 0; k < stages; k++) {
        float least = INFINITY;
        int best = first[k];
        for (int b = first[k]; b < first[k + 1]; b++) {
            float distance = square(difference(r, read_vector(codebooks, b)));
            if (distance < least) {
                least = distance;
                best = b;
            }
        }
        r = difference(r, read_vector(codebooks, best));
        indices[(size_t)n * stages + k] = (unsigned short)(best - first[k]);
    }
}

/* (10-21): the gradient of each vector, and the sum of the squares over each block. */
extern "C" __global__ void __launch_bounds__(THREADS)
commitment(const float *x, const unsigned short *indices, const int *first, const float *codebooks, int stages, int count,
           float components, float *grad_x, double *losses)
{
    int n = thread_of_grid();
    double squares = 0;
    if (n < count) {
        float3 r = read_vector(x, n), total = make_float3(0, 0, 0);
        for (int k = 0; k < stages; k++) {
            r = difference(r, read_vector(codebooks, first[k] + indices[(size_t)n * stages + k]));
            squares += (double)r.x * r.x + (double)r.y * r.y + (double)r.z * r.z;
            total = make_float3(total.x + r.x, total.y + r.y, total.z + r.z);
        }
        write_vector(grad_x, n, make_float3(2 * total.x / components, 2 * total.y / components, 2 * total.z / components));
    }
    double sum = sum_of_block<WARPS>(squares);
    if (threadIdx.x == 0)
        losses[blockIdx.x] = sum;
}

/* One thread for each splat: its residuals r of all stages, before and after each; those of stage k begin at k * count. */
extern "C" __global__ void rvq_residuals(const float *x, const unsigned short *indices, const int *first,
                                         const float *codebooks, int stages, int count, float *residuals)
{
    int n = thread_of_grid();
    if (n >= count)
        return;
    float3 r = read_vector(x, n);
    write_vector(residuals, n, r);
    for (int k = 0; k < stages; k++) {
        r = difference(r, read_vector(codebooks, first[k] + indices[(size_t)n * stages + k]));
        write_vector(residuals, (k + 1) * (size_t)count + n, r);
    }
}

/* (10-22), one block for each codeword: its threads look for the splats that use it. */
extern "C" __global__ void __launch_bounds__(THREADS)
rvq_average(const float *residuals, const unsigned short *indices, const int *first, int stages, int count, double decay,
            double *counts, double *sums)
{
    int codeword = blockIdx.x, k = 0;
    while (codeword >= first[k + 1])
        k++;
    double used[4] = {0, 0, 0, 0};          /* r, and how often */
    for (int n = threadIdx.x; n < count; n += THREADS)
        if (indices[(size_t)n * stages + k] == codeword - first[k]) {
            float3 r = read_vector(residuals, k * (size_t)count + n);
            used[0] += r.x;
            used[1] += r.y;
            used[2] += r.z;
            used[3] += 1;
        }
    for (int component = 0; component < 4; component++) {
        double sum = sum_of_block<WARPS>(used[component]);
        double *mean = component < 3 ? sums + 3 * codeword + component : counts + codeword;
        if (threadIdx.x == 0)
            *mean = decay * *mean + (1 - decay) * sum;
    }
}

/* (10-23), one block for each stage. */
extern "C" __global__ void __launch_bounds__(THREADS)
rvq_move(const int *first, const double *counts, const double *sums, double smoothing, float *codebooks)
{
    int begin = first[blockIdx.x], end = first[blockIdx.x + 1];
    double own = 0;
    for (int b = begin + threadIdx.x; b < end; b += THREADS)
        own += counts[b];
    double total = sum_of_block<WARPS>(own);
    for (int b = begin + threadIdx.x; b < end; b += THREADS) {
        double smoothed = (counts[b] + smoothing) / (total + (end - begin) * smoothing) * total;
        for (int component = 0; component < 3 && smoothed > 0; component++)     /* else the codeword stays as it is */
            codebooks[3 * b + component] = (float)(sums[3 * b + component] / smoothed);
    }
}

/* reach[j] = E_j of (10-24) for the errors of a stage; the sum of all is returned to every thread. */
static __device__ double reach_of_errors(const float *errors, int count, double *reach)
{
    double carried = 0;
    for (int begin = 0; begin < count; begin += THREADS) {
        int n = begin + threadIdx.x;
        float3 e = n < count ? read_vector(errors, n) : make_float3(0, 0, 0);
        double total, squares = (double)e.x * e.x + (double)e.y * e.y + (double)e.z * e.z;
        double before = sum_before<WARPS>(squares, &total);
        if (n < count)
            reach[n] = carried + before + squares;
        carried += total;
    }
    return carried;
}

/* (10-24), one block for all: who is dead in a stage takes numbers that the stages before have left, in order. */
extern "C" __global__ void __launch_bounds__(THREADS)
rvq_replace_dead(const float *residuals, const int *first, int stages, int count, double dead_count, const double *uniforms,
                 double *reach, double *counts, double *sums, float *codebooks)
{
    __shared__ int drawn;
    int taken = 0;
    for (int k = 0; k < stages; k++) {
        const float *r = residuals + 3 * (k * (size_t)count), *errors = r + 3 * (size_t)count;
        double whole = reach_of_errors(errors, count, reach);
        for (int b = first[k]; b < first[k + 1]; b++) {
            if (!(counts[b] < dead_count && whole > 0))         /* all threads agree */
                continue;
            if (threadIdx.x == 0)
                drawn = count - 1;
            __syncthreads();                /* `reach` is complete */
            for (int n = threadIdx.x; n < count; n += THREADS)
                if (reach[n] > uniforms[taken] * whole) {
                    atomicMin(&drawn, n);
                    break;
                }
            __syncthreads();                /* all are done with `reach` and have read counts[b], too */
            if (threadIdx.x == 0) {
                float3 vector = read_vector(r, drawn);
                counts[b] = 1;
                sums[3 * b] = vector.x;
                sums[3 * b + 1] = vector.y;
                sums[3 * b + 2] = vector.z;
                write_vector(codebooks, b, vector);
            }
            taken++;
        }
    }
}

/* Codewords become what a stream can hold: binary16, ties to even. */
extern "C" __global__ void round_to_half(float *values, int count)
{
    int n = thread_of_grid();
    if (n >= count)
        return;
    float magnitude = fabsf(values[n]);
    unsigned bits = __float_as_uint(magnitude);
    float rounded = __uint_as_float((bits + 0xfff + (bits >> 13 & 1)) & ~0x1fffu);     /* 11 bits are left */
    if (magnitude < 0x1p-14f)
        rounded = __fsub_rn(__fadd_rn(magnitude, 0.5f), 0.5f);                          /* a multiple of 2^-24 */
    values[n] = copysignf(rounded > 65504 ? INFINITY : rounded, values[n]);
}

/* What training does to every pixel and to every parameter (10.2 to 10.4), and which splats leave and come (10.7, 10.8). */

#include "common.cuh"

#define WARPS 8
#define THREADS (32 * WARPS)

/* One thread for each sample: (10-2), and the sum of the squares of (10-1) over each block. */
extern "C" __global__ void __launch_bounds__(THREADS)
loss(const float *picture, const float *target, long long samples, float pixels, float *residual, double *losses)
{
    long long at = blockIdx.x * (long long)THREADS + threadIdx.x;
    float difference = 0;
    if (at < samples) {
        difference = fminf(fmaxf(picture[at], 0.0f), 1.0f) - target[at];
        residual[at] = 2 * difference / pixels;         /* straight through the clamp */
    }
    double sum = sum_of_block<WARPS>((double)difference * difference);
    if (threadIdx.x == 0)
        losses[blockIdx.x] = sum;
}

/* (10-10): a row of `values` is x, y, l11, l21, l22, the colour c', w. */
extern "C" __global__ void weighted_parameters(const float *values, int splat_count, float *parameters)
{
    int n = thread_of_grid();
    if (n >= splat_count)
        return;
    const float *row = values + 9 * (size_t)n;
    float *p = parameters + 8 * (size_t)n;
    for (int column = 0; column < 8; column++)
        p[column] = column < 5 ? row[column] : __fmul_rn(row[8], row[column]);
}

/* (10-11) */
extern "C" __global__ void weighted_gradients(const float *values, const float *by_product, int splat_count, float *gradients)
{
    int n = thread_of_grid();
    if (n >= splat_count)
        return;
    const float *row = values + 9 * (size_t)n, *G = by_product + 8 * (size_t)n;
    float *gradient = gradients + 9 * (size_t)n;
    float of_weight = 0;
    for (int column = 0; column < 5; column++)
        gradient[column] = G[column];
    for (int column = 5; column < 8; column++) {
        gradient[column] = row[8] * G[column];
        of_weight += G[column] * row[column];
    }
    gradient[8] = of_weight;
}

/* What follows from the decay rates alone, formed in binary64 by the host: 1 - 0.99f has lost five bits (10.4). */
struct Decay {
    float beta1, beta2, beta3;
    float rest1, rest2, rest3;              /* 1 - beta */
    float epsilon;
};

/* One thread for each parameter: (10-13) and (10-14). A row of `corrections` has 1 / (1 - beta^k) for the three decay rates
   and 0 in the first step of the row, 1 later. */
extern "C" __global__ void adan_step(float *parameters, const float *gradients, float *m, float *v, float *n, float *previous,
                                     const float4 *corrections, const float *rates, const float *units, int columns,
                                     long long count, Decay decay)
{
    long long at = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (at >= count)
        return;
    float4 correction = corrections[at / columns];
    float unit = units[at % columns], rate = rates[at % columns];
    float g = unit * gradients[at];
    float d = correction.w == 0 ? 0.0f : g - previous[at];
    float ahead = g + decay.beta2 * d;
    float new_m = decay.beta1 * m[at] + decay.rest1 * g;
    float new_v = decay.beta2 * v[at] + decay.rest2 * d;
    float new_n = decay.beta3 * n[at] + decay.rest3 * (ahead * ahead);
    float root = __fsqrt_rn(new_n * correction.z);
    float update = (new_m * correction.x + decay.beta2 * (new_v * correction.y)) / (root + decay.epsilon);
    parameters[at] -= unit * rate * update;
    m[at] = new_m;
    v[at] = new_v;
    n[at] = new_n;
    previous[at] = g;
}

/* |w| as an integer, which is in the same order; -0 is 0. */
static __device__ __forceinline__ unsigned key_of(float weight) { return __float_as_uint(fabsf(weight)); }

/* How many of the keys are below a limit; every thread gets it. */
static __device__ __forceinline__ int count_below(const float *weights, int count, unsigned limit)
{
    int own = 0;
    for (int n = threadIdx.x; n < count; n += THREADS)
        own += key_of(weights[n]) < limit;
    return sum_of_block<WARPS>(own);
}

/* R-10.7-2 without sorting; one block, since it is done once in a hundred iterations. First, bit by bit, the largest limit
   with no more than `removed` keys below it: these leave, and of those equal to it the last ones. Then those that stay are
   written in their order. */
extern "C" __global__ void __launch_bounds__(THREADS) prune(const float *weights, int count, int removed, long long *survivors)
{
    unsigned limit = 0;
    for (unsigned bit = 1u << 30; bit > 0; bit >>= 1)   /* keys have 31 bits */
        if (count_below(weights, count, limit | bit) <= removed)
            limit |= bit;
    int below = count_below(weights, count, limit), equal = count_below(weights, count, limit + 1) - below;
    int equal_that_stay = equal - min(equal, removed - below), equal_seen = 0, place = 0;
    for (int first = 0; first < count; first += THREADS) {
        int n = first + threadIdx.x, equal_here, staying;
        unsigned key = n < count ? key_of(weights[n]) : 0;
        bool is_equal = n < count && key == limit;
        int equal_before = equal_seen + sum_before<WARPS>((int)is_equal, &equal_here);
        bool stays = n < count && (key > limit || (is_equal && equal_before < equal_that_stay));
        int before = sum_before<WARPS>((int)stays, &staying);
        if (stays)
            survivors[place + before] = n;
        equal_seen += equal_here;
        place += staying;
    }
}

/* R-10.7-3: one thread for each number that is left. Not in place, since a row may be read after it was written over. */
extern "C" __global__ void compact(const float *rows, const long long *survivors, int columns, long long count, float *left)
{
    long long at = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (at < count)
        left[at] = rows[survivors[at / columns] * columns + at % columns];
}

/* (10-26), (10-27): one thread for each new splat. */
extern "C" __global__ void augment(const float *uniforms, int added, float width, float height, float *values)
{
    int n = thread_of_grid();
    if (n >= added)
        return;
    const float *a = uniforms + 8 * (size_t)n;
    float *row = values + 9 * (size_t)n;
    row[0] = __fmul_rn(a[0], width);
    row[1] = __fmul_rn(a[1], height);
    row[2] = __fadd_rn(a[2], 0.5f);
    row[3] = a[3];
    row[4] = __fadd_rn(a[4], 0.5f);
    for (int column = 5; column < 8; column++)
        row[column] = a[column];
    row[8] = 0.01f;
}

/* What training does to every pixel and to every parameter (10.2 to 10.4). */

/* Sum over the work-group of LANES; every lane gets it. */
float sum_of_group(float value, local float *sums)
{
    uint lane = get_local_id(0);
    sums[lane] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint half_of = LANES / 2; half_of > 0; half_of /= 2) {
        if (lane < half_of)
            sums[lane] += sums[lane + half_of];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    float sum = sums[0];
    barrier(CLK_LOCAL_MEM_FENCE);
    return sum;
}

/* One work-item for each sample: (10-2), and the sum of (10-1) over each work-group, always in the same order. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void loss(global const float *picture, global const float *target, ulong samples, float pixels, global float *residual,
          global float *partial)
{
    local float sums[LANES];
    size_t at = get_global_id(0);
    float difference = 0;
    if (at < samples) {
        difference = clamp(picture[at], 0.0f, 1.0f) - target[at];
        residual[at] = 2 * difference / pixels;         /* straight through the clamp */
    }
    float sum = sum_of_group(difference * difference, sums);
    if (get_local_id(0) == 0)
        partial[get_group_id(0)] = sum;
}

/* One work-group: the sum of what all groups of a kernel have left, divided. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void sum_partial(global const float *partial, uint count, float divisor, global float *result)
{
    local float sums[LANES];
    float own = 0;
    for (uint k = get_local_id(0); k < count; k += LANES)
        own += partial[k];
    float sum = sum_of_group(own, sums);
    if (get_local_id(0) == 0)
        *result = sum / divisor;
}

/* (10-10): a row of `values` is x, y, l11, l21, l22, the colour c', w. Exact: fl(w c'). */
kernel void weighted_parameters(global const float *values, uint splat_count, global float *parameters)
{
    uint n = get_global_id(0);
    if (n >= splat_count)
        return;
    global const float *row = values + 9 * (size_t)n;
    global float *p = parameters + 8 * (size_t)n;
    for (uint column = 0; column < 5; column++)
        p[column] = row[column];
    for (uint column = 5; column < 8; column++)
        p[column] = row[8] * row[column];
}

/* (10-11) */
kernel void weighted_gradients(global const float *values, global const float *by_product, uint splat_count,
                               global float *gradients)
{
    uint n = get_global_id(0);
    if (n >= splat_count)
        return;
    global const float *row = values + 9 * (size_t)n, *G = by_product + 8 * (size_t)n;
    global float *gradient = gradients + 9 * (size_t)n;
    float of_weight = 0;
    for (uint column = 0; column < 5; column++)
        gradient[column] = G[column];
    for (uint column = 5; column < 8; column++) {
        gradient[column] = row[8] * G[column];
        of_weight += G[column] * row[column];
    }
    gradient[8] = of_weight;
}

/* What follows from the decay rates alone, formed in binary64 by the host: 1 - 0.99f has lost five bits (10.4). */
typedef struct {
    float beta1, beta2, beta3;
    float rest1, rest2, rest3;              /* 1 - beta */
    float epsilon;
} Decay;

/* One work-item for each parameter: (10-13) and (10-14). A row of `correction` has 1 / (1 - beta^k) for the three decay rates
   and 0 in the first step of the row, 1 later. */
kernel void adan_step(global float *parameters, global const float *gradients, global float *m, global float *v,
                      global float *n, global float *previous, global const float4 *correction, global const float *rates,
                      global const float *units, uint columns, ulong count, Decay decay)
{
    size_t at = get_global_id(0);
    if (at >= count)
        return;
    float4 corrected = correction[at / columns];
    float unit = units[at % columns], rate = rates[at % columns];
    float g = unit * gradients[at];
    float d = corrected.w == 0 ? 0 : g - previous[at];
    float ahead = g + decay.beta2 * d;
    float new_m = decay.beta1 * m[at] + decay.rest1 * g;
    float new_v = decay.beta2 * v[at] + decay.rest2 * d;
    float new_n = decay.beta3 * n[at] + decay.rest3 * (ahead * ahead);
    float update = (new_m * corrected.x + decay.beta2 * (new_v * corrected.y)) / (root(new_n * corrected.z) + decay.epsilon);
    parameters[at] -= unit * rate * update;
    m[at] = new_m;
    v[at] = new_v;
    n[at] = new_n;
    previous[at] = g;
}

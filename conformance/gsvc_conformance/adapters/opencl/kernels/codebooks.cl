/* How the codebooks of training follow what uses them: (10-22) to (10-24). */

/* One work-item for each splat: its residuals r of all stages, before and after each; those of stage k begin at k * count. */
kernel void rvq_residuals(global const float *x, global const ushort *indices, global const uint *first,
                          global const float *codebooks, uint stages, uint count, global float *residuals)
{
    uint n = get_global_id(0);
    if (n >= count)
        return;
    float3 r = vload3(n, x);
    vstore3(r, n, residuals);
    for (uint k = 0; k < stages; k++) {
        r -= vload3(first[k] + indices[(size_t)n * stages + k], codebooks);
        vstore3(r, (k + 1) * (size_t)count + n, residuals);
    }
}

float4 sum4_of_group(float4 value, local float *sums)
{
    return (float4)(sum_of_group(value.x, sums), sum_of_group(value.y, sums), sum_of_group(value.z, sums),
                    sum_of_group(value.w, sums));
}

/* (10-22), one work-group for each codeword: its lanes look for the splats that use it. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void rvq_average(global const float *residuals, global const ushort *indices, global const uint *first, uint stages,
                 uint count, float decay, float rest, global float *counts, global float *sums)
{
    local float scratch[LANES];
    uint codeword = get_group_id(0), k = 0;
    while (codeword >= first[k + 1])
        k++;
    float4 used = 0;                        /* r, and how often */
    for (uint n = get_local_id(0); n < count; n += LANES)
        if (indices[(size_t)n * stages + k] == codeword - first[k])
            used += (float4)(vload3(k * (size_t)count + n, residuals), 1);
    used = sum4_of_group(used, scratch);
    if (get_local_id(0) == 0) {
        counts[codeword] = decay * counts[codeword] + rest * used.w;
        vstore3(decay * vload3(codeword, sums) + rest * used.xyz, codeword, sums);
    }
}

/* (10-23), one work-group for each stage. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void rvq_move(global const uint *first, global const float *counts, global const float *sums, float smoothing,
              global float *codebooks)
{
    local float scratch[LANES];
    uint begin = first[get_group_id(0)], end = first[get_group_id(0) + 1];
    float own = 0;
    for (uint b = begin + get_local_id(0); b < end; b += LANES)
        own += counts[b];
    float total = sum_of_group(own, scratch);
    for (uint b = begin + get_local_id(0); b < end; b += LANES) {
        float smoothed = (counts[b] + smoothing) / (total + (end - begin) * smoothing) * total;
        if (smoothed > 0)                   /* else the codeword stays as it is */
            vstore3(vload3(b, sums) / smoothed, b, codebooks);
    }
}

/* reach[j] = E_j of (10-24) for the errors of a stage; the sum of all is returned to every lane. */
float reach_of_errors(global const float *errors, uint count, global float *reach, local float *sums)
{
    uint lane = get_local_id(0);
    float carried = 0;
    for (uint begin = 0; begin < count; begin += LANES) {
        uint n = begin + lane;
        float3 error = vload3(min(n, count - 1), errors);
        sums[lane] = n < count ? dot(error, error) : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint step = 1; step < LANES; step *= 2) {
            float before = lane >= step ? sums[lane - step] : 0;
            barrier(CLK_LOCAL_MEM_FENCE);
            sums[lane] += before;
            barrier(CLK_LOCAL_MEM_FENCE);
        }
        if (n < count)
            reach[n] = carried + sums[lane];
        carried += sums[LANES - 1];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    barrier(CLK_GLOBAL_MEM_FENCE);          /* other lanes will read what this one wrote */
    return carried;
}

/* (10-24), one work-group for all: who is dead in a stage takes numbers that the stages before have left, in order. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void rvq_replace_dead(global const float *residuals, global const uint *first, uint stages, uint count, float dead_count,
                      global const float *uniforms, global float *reach, global float *counts, global float *sums,
                      global float *codebooks)
{
    local float scratch[LANES];
    local uint drawn;
    uint taken = 0;
    for (uint k = 0; k < stages; k++) {
        global const float *r = residuals + 3 * (k * (size_t)count), *errors = r + 3 * (size_t)count;
        float whole = reach_of_errors(errors, count, reach, scratch);
        for (uint b = first[k]; b < first[k + 1]; b++) {
            if (!(counts[b] < dead_count && whole > 0))     /* all lanes agree */
                continue;
            if (get_local_id(0) == 0)
                drawn = count - 1;
            barrier(CLK_LOCAL_MEM_FENCE);
            for (uint n = get_local_id(0); n < count; n += LANES)
                if (reach[n] > uniforms[taken] * whole) {
                    atomic_min(&drawn, n);
                    break;
                }
            barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);    /* of counts[b], too: all have read it */
            if (get_local_id(0) == 0) {
                float3 vector = vload3(drawn, r);
                counts[b] = 1;
                vstore3(vector, b, sums);
                vstore3(vector, b, codebooks);
            }
            taken++;
        }
    }
}

/* Codewords become what a stream can hold: binary16, ties to even. */
kernel void round_to_half(global float *values, uint count, global half *scratch)
{
    uint n = get_global_id(0);
    if (n < count) {
        vstore_half_rte(values[n], n, scratch);
        values[n] = vload_half(n, scratch);
    }
}

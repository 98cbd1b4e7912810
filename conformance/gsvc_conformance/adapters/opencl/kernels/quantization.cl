/* Quantisation in training: LSQ+ (10.5) and residual vectors (10.6). */

/* t of (10-15). Two roundings, and a decision follows: exact, or codes flip. */
float lsq_ratio(float x, float scale, float offset)
{
    return QUOTIENT(x - offset, scale);
}

/* (10-16), one work-item for each value. */
kernel void lsq_quantize(global const float *x, global const float *scale, global const float *offset, uint channels,
                         float largest, ulong count, global ushort *codes)
{
    size_t at = get_global_id(0);
    if (at < count) {
        float t = lsq_ratio(x[at], scale[at % channels], offset[at % channels]);
        codes[at] = (ushort)rint(clamp(t, 0.0f, largest));
    }
}

/* (10-18) and (10-19), one work-group for each channel: its lanes go through the splats, a tree adds what they found. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void lsq_gradients(global const float *x, global const float *scale, global const float *offset, float largest,
                   global const float *grad_output, uint rows, uint channels, global float *grad_x, global float *grad_scale,
                   global float *grad_offset)
{
    local float sums[LANES];
    uint channel = get_group_id(0);
    float of_scale = 0, of_offset = 0;
    for (size_t row = get_local_id(0); row < rows; row += LANES) {
        size_t at = row * channels + channel;
        float t = lsq_ratio(x[at], scale[channel], offset[channel]), grad = grad_output[at];
        bool inside = t >= 0 && t <= largest;           /* the ends are inside */
        grad_x[at] = inside ? grad : 0;
        of_scale += inside ? grad * (rint(t) - t) : t > largest ? grad * largest : 0;
        of_offset += inside ? 0 : grad;
    }
    float scale_sum = sum_of_group(of_scale, sums), offset_sum = sum_of_group(of_offset, sums);
    if (get_local_id(0) == 0) {
        grad_scale[channel] = scale_sum;
        grad_offset[channel] = offset_sum;
    }
}

/* (10-20), one work-item for each vector. The codewords of a stage come in batches through local memory; all lanes read the
   same one at the same time. Codewords are taken in ascending order and only a smaller distance replaces the best:
   the least index where distances are equal. Each square and sum rounds by itself, so exact. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void rvq_assign(global const float *x, global const uint *first, global const float *codebooks, uint stages, uint count,
                global ushort *indices)
{
    local float batch[3 * LANES];
    uint n = get_global_id(0);
    float3 r = vload3(min(n, count - 1), x);            /* lanes beyond the end stay for the barriers */
    for (uint k = 0; k < stages; k++) {
        float least = INFINITY;
        uint best = 0;
        for (uint begin = first[k]; begin < first[k + 1]; begin += LANES) {
            uint size = min((uint)LANES, first[k + 1] - begin);
            for (uint word = get_local_id(0); word < 3 * size; word += LANES)
                batch[word] = codebooks[3 * (size_t)begin + word];
            barrier(CLK_LOCAL_MEM_FENCE);
            for (uint b = 0; b < size; b++) {
                float3 e = r - vload3(b, batch);
                float distance = (e.x * e.x + e.y * e.y) + e.z * e.z;
                if (distance < least) {
                    least = distance;
                    best = begin - first[k] + b;
                }
            }
            barrier(CLK_LOCAL_MEM_FENCE);
        }
        r -= vload3(first[k] + best, codebooks);
        if (n < count)
            indices[(size_t)n * stages + k] = (ushort)best;
    }
}

/* (10-21): the gradient of each vector, and the sum of the squares over each work-group. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void commitment(global const float *x, global const ushort *indices, global const uint *first, global const float *codebooks,
                uint stages, uint count, float components, global float *grad_x, global float *partial)
{
    local float sums[LANES];
    uint n = get_global_id(0);
    float squares = 0;
    if (n < count) {
        float3 r = vload3(n, x), total = 0;
        for (uint k = 0; k < stages; k++) {
            r -= vload3(first[k] + indices[(size_t)n * stages + k], codebooks);
            squares += dot(r, r);
            total += r;
        }
        vstore3(2 * total / components, n, grad_x);
    }
    float sum = sum_of_group(squares, sums);
    if (get_local_id(0) == 0)
        partial[get_group_id(0)] = sum;
}

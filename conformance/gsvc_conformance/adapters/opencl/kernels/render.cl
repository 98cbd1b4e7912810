/* From lists of tiles to sums of pixels, and from sums to samples. */

/* One work-group for each tile of TILE x TILE pixels, one work-item for each pixel. The splats of the tile come in batches
   through local memory: each is read once from global memory for all pixels of the tile. No pixel stops early: there is no
   opacity here that could be used up, and no limit to the number of splats of a pixel (9.1). */
kernel __attribute__((reqd_work_group_size(TILE, TILE, 1)))
void render_sum(global const Splat *splats, global const uint *list, global const ulong *start, uint width, uint height,
                uint first_row, global float *sum)
{
    local Splat batch[TILE * TILE];
    uint lane = get_local_id(1) * TILE + get_local_id(0);
    uint tile = get_group_id(1) * get_num_groups(0) + get_group_id(0);
    uint i = get_global_id(0), j = first_row * TILE + get_global_id(1);
    float red = 0, green = 0, blue = 0;
    for (ulong first = start[tile]; first < start[tile + 1]; first += TILE * TILE) {
        uint count = (uint)min((ulong)(TILE * TILE), start[tile + 1] - first);
        if (lane < count)
            batch[lane] = splats[list[first + lane]];
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint k = 0; k < count; k++) {
            float m = squared_distance(whitened(batch[k], i, j));
            if (m <= SUPPORT_SQUARED) {
                float g = weight(m);
                red += g * batch[k].red;    /* (9-2), and in the order of the list (9-6) */
                green += g * batch[k].green;
                blue += g * batch[k].blue;
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);       /* nobody may read a batch that is being replaced */
    }
    if (i < width && j < height) {          /* work-items beyond the edge were needed to load and at the barriers */
        size_t at = 3 * ((size_t)j * width + i);
        sum[at] = red;
        sum[at + 1] = green;
        sum[at + 2] = blue;
    }
}

/* One work-item for each sample: (9-7), which bounded rendering may use as well. Both comparisons fail for a NaN: black. */
kernel void to_frame(global const float *sum, ulong samples, uint bit_depth, global uchar *frame)
{
    size_t at = get_global_id(0);
    if (at >= samples)
        return;
    float v = sum[at] > 0 ? sum[at] : 0;
    v = sum[at] >= 1 ? 1 : v;
    float sample = rint(v * (float)((1u << bit_depth) - 1));
    if (bit_depth == 8)
        frame[at] = (uchar)sample;
    else
        ((global ushort *)frame)[at] = (ushort)sample;
}

/* (9-8), one work-item for each splat. */
kernel void scale_parameters(global const float *parameters, uint splat_count, float width, float height, float new_width,
                             float new_height, global float *scaled)
{
    uint n = get_global_id(0);
    if (n >= splat_count)
        return;
    float a = QUOTIENT(new_width, width), e = QUOTIENT(new_height, height);
    const float factors[8] = {a, e, a, e, e, 1, 1, 1};
    for (uint column = 0; column < 8; column++)
        scaled[8 * (size_t)n + column] = parameters[8 * (size_t)n + column] * factors[column];
}

/* The root of p^2 + q^2, p > 0, whose squares may leave the range of binary32. */
float hypotenuse(float p, float q)
{
    float larger = fmax(p, fabs(q)), ratio = fmin(p, fabs(q)) / larger;
    return larger * root(1 + ratio * ratio);
}

/* (9-9), one work-item for each splat. The roots of v_x and v_y come from the host, 0 for a side that is not made smaller. */
kernel void scale_parameters_filtered(global const float *parameters, uint splat_count, float a, float e, float h_x,
                                      float h_y, global float *filtered)
{
    uint n = get_global_id(0);
    if (n >= splat_count)
        return;
    float8 p = vload8(n, parameters);
    bool drawn = p.s2 >= SMALLEST_NORMAL && p.s4 >= SMALLEST_NORMAL;    /* R-9.4-3 */
    p.s02 *= a;
    p.s134 *= e;
    if (drawn) {
        float m11 = h_x > 0 ? hypotenuse(p.s2, h_x) : p.s2;
        float m22 = h_y > 0 ? hypotenuse(p.s4, h_y) : p.s4;
        if (h_x > 0)
            m22 = hypotenuse(m22, p.s3 * (h_x / m11));
        float across = h_x > 0 ? p.s2 / m11 : 1;
        p.s567 *= across * (p.s4 / m22);
        p.s234 = (float3)(m11, p.s3 * across, m22);
    }
    vstore8(p, n, filtered);
}

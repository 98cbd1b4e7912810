/* Splats from their codes (section 8). Every operation rounds by itself (R-3.3-1), so these kernels are for the EXACT build.

   vload_half and vstore_half_rte are in every OpenCL, whether or not it computes with halves; they are (8-5) and (8-6). */

kernel void from_half(global const half *bits, uint count, global float *values)
{
    uint n = get_global_id(0);
    if (n < count)
        values[n] = vload_half(n, bits);
}

kernel void to_half(global const float *values, uint count, global half *bits)
{
    uint n = get_global_id(0);
    if (n < count)
        vstore_half_rte(values[n], n, bits);
}

/* fl(fl(q s) + beta) of (8-3) and (10-17). */
float dequantized(uint code, float scale, float offset)
{
    return (float)code * scale + offset;
}

kernel void lsq_dequantize(global const ushort *codes, global const float *scale, global const float *offset, uint channels,
                           ulong count, global float *values)
{
    size_t at = get_global_id(0);
    if (at < count)
        values[at] = dequantized(codes[at], scale[at % channels], offset[at % channels]);
}

/* What a splat block says of its attributes, row by row. */
typedef struct {
    uint positions_present, cholesky_present, colors_present;
    uint stage_count;
    float half_width, half_height;          /* W/2 and H/2, exact */
} Block;

/* The sum of the codewords of splat n in the order of the stages (8-4); those of stage k begin at codeword first[k]. */
float3 codeword_sum(global const ushort *color_indices, global const uint *first, global const half *codewords,
                    uint stage_count, uint n)
{
    float3 sum = 0;
    for (uint k = 0; k < stage_count; k++) {
        float3 codeword = vload_half3(first[k] + color_indices[(size_t)n * stage_count + k], codewords);
        sum = k == 0 ? codeword : sum + codeword;       /* not 0 + codeword, which would lose the sign of -0 */
    }
    return sum;
}

kernel void reconstruct_intra(global const half *positions, global const ushort *cholesky, global const float *scale,
                              global const float *offset, global const ushort *color_indices, global const uint *first,
                              global const half *codewords, Block block, uint splat_count, global float *parameters)
{
    uint n = get_global_id(0);
    if (n >= splat_count)
        return;
    global float *p = parameters + 8 * (size_t)n;
    p[0] = (vload_half(2 * (size_t)n, positions) + 1) * block.half_width;           /* (8-1), (8-2) */
    p[1] = (vload_half(2 * (size_t)n + 1, positions) + 1) * block.half_height;
    for (uint channel = 0; channel < 3; channel++)                                  /* (8-3) */
        p[2 + channel] = dequantized(cholesky[3 * (size_t)n + channel], scale[channel], offset[channel]);
    vstore3(codeword_sum(color_indices, first, codewords, block.stage_count, n), 0, p + 5);         /* (8-4) */
}

/* One work-item for each splat of the frame before; rank[n] is how many splats before n survive, which `scan` of lists.cl
   tells. Survivors keep their order. An attribute that is not present is not touched: adding 0 would turn -0 into +0. */
kernel void reconstruct_inter(global const float *reference, global const uint *survivors, global const ulong *rank,
                              global const half *positions, global const ushort *cholesky, global const float *scale,
                              global const float *offset, global const ushort *color_indices, global const uint *first,
                              global const half *codewords, Block block, uint reference_count, global float *parameters)
{
    uint old = get_global_id(0);
    if (old >= reference_count || !survivors[old])
        return;
    uint n = (uint)rank[old];
    global float *p = parameters + 8 * (size_t)n;
    float8 splat = vload8(old, reference);
    if (block.positions_present) {                                                  /* (8-1), (8-2) */
        splat.s0 += vload_half(2 * (size_t)n, positions) * block.half_width;
        splat.s1 += vload_half(2 * (size_t)n + 1, positions) * block.half_height;
    }
    vstore8(splat, n, parameters);
    if (block.cholesky_present)                                                     /* (8-3) */
        for (uint channel = 0; channel < 3; channel++)
            p[2 + channel] += dequantized(cholesky[3 * (size_t)n + channel], scale[channel], offset[channel]);
    if (block.colors_present)                                                       /* (8-4) */
        vstore3(splat.s567 + codeword_sum(color_indices, first, codewords, block.stage_count, n), 0, p + 5);
}

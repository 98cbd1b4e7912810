/* What a decoder checks of a frame before it renders it: the rendering work (R-5-4) and the checksum (R-6.4-3). */

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define REACH_64 0x1.aa1ee98abcac8p+1       /* rho' of Annex A */

/* Pixels from floor(centre - e) to ceil(centre + e) inside 0..size (5-1). Clamped before the conversion to integers. */
ulong side_of_box(double centre, double e, double size)
{
    double first = fmax(floor(centre - e), 0.0), end = fmin(ceil(centre + e), size);
    return end > first ? (ulong)(end - first) : 0;
}

/* One work-item for each splat: the pixels of its box, added to a sum of 64 bits for each work-group. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void rendering_work(global const float *parameters, uint splat_count, uint width, uint height, global ulong *partial)
{
    local ulong sums[LANES];
    uint n = get_global_id(0), lane = get_local_id(0);
    sums[lane] = 0;
    if (n < splat_count) {
        global const float *p = parameters + 8 * (size_t)n;
        bool drawn = p[2] >= SMALLEST_NORMAL && p[4] >= SMALLEST_NORMAL && p[2] < INFINITY && p[4] < INFINITY;
        if (drawn)
            sums[lane] = side_of_box(p[0], REACH_64 * p[2], width)
                         * side_of_box(p[1], REACH_64 * (fabs((double)p[3]) + (double)p[4]), height);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint half_of = LANES / 2; half_of > 0; half_of /= 2) {
        if (lane < half_of)
            sums[lane] += sums[lane + half_of];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (lane == 0)
        partial[get_group_id(0)] = sums[0];
}
#endif

#define POLYNOMIAL 0x82f63b78u              /* CRC-32C, reflected: the top bit is the coefficient of x^0 (6.2) */
#define RUN 32                              /* words of a work-item */

/* The product of two polynomials modulo that of the CRC. */
uint product(uint a, uint b)
{
    uint sum = 0;
    for (; b != 0; b <<= 1) {
        if (b & 0x80000000u)
            sum ^= a;
        a = a & 1 ? a >> 1 ^ POLYNOMIAL : a >> 1;
    }
    return sum;
}

uint power_of_x(ulong exponent)
{
    uint power = 0x80000000u;               /* x^0 */
    for (uint square = 0x40000000u; exponent != 0; exponent >>= 1, square = product(square, square))
        if (exponent & 1)
            power = product(power, square);
    return power;
}

/* The k-th word of what the checksum is of: all positions, then all Cholesky factors, then all colours (R-6.4-3). */
uint word(global const uint *parameters, ulong splat_count, ulong k)
{
    if (k < 2 * splat_count)
        return parameters[k / 2 * 8 + k % 2];
    k -= 2 * splat_count;
    uint column = k < 3 * splat_count ? 2 : 5;
    k -= k < 3 * splat_count ? 0 : 3 * splat_count;
    return parameters[k / 3 * 8 + column + k % 3];
}

/* A CRC is a remainder of polynomials, and those add up: each work-item takes the remainder of RUN words and multiplies it
   by x to the number of bits that follow. Exclusive or, unlike the addition of floats, may be in any order. `checksum`
   begins with all bits set, which is what is added at the end; a CRC of no words still has a work-item. */
kernel void parameter_checksum(global const uint *parameters, ulong splat_count, global uint *checksum)
{
    ulong words = 8 * splat_count, first = (ulong)get_global_id(0) * RUN, end = min(first + RUN, words);
    uint remainder = first == 0 ? 0xffffffffu : 0;
    for (ulong k = first; k < end; k++)
        remainder = product(remainder ^ word(parameters, splat_count, k), 0x82f63b78u);   /* x^32 */
    atomic_xor(checksum, product(remainder, power_of_x(32 * (words - end))));
}

/* dL/dparameters of splats from dL/dC of pixels (10.3), coverage held fixed. */

#define BLOCK 8

/* The factor l21 / (l11 l22) of (13-12). Of three factors, two from both sides of 1 go first (s.f is at least 1): so no step
   leaves the range of binary32 unless the result does. A splat far thinner than a pixel would get 0 inf = NaN. */
float slope(Splat s)
{
    return s.r1 <= 1 ? (s.f * s.r1) * s.l : (s.l * s.r1) * s.f;
}

/* One work-group for each splat. It walks over the blocks of BLOCK x BLOCK pixels of the splat's box, one work-item for
   each pixel of a block, and sums eight numbers: the moments of (13-12) and (10-9). All sums of a splat stay in its group,
   so that no work-group adds to what another one adds to: OpenCL has no atomic addition of floats, and with one
   each run would round in another order. Here the order is always the same; each lane adds a 64th of the pixels, and a
   tree the lanes, which rounds less than one long sum.

   The moments have no factor of the splat inside the sum; l11, l21 and l22 come in once, at the end. */
kernel __attribute__((reqd_work_group_size(BLOCK, BLOCK, 1)))
void render_gradients(global const Splat *splats, global const float *residual, uint width, uint height,
                      global float *gradients)
{
    local float8 sums[BLOCK * BLOCK];
    uint lane = get_local_id(1) * BLOCK + get_local_id(0);
    size_t n = get_group_id(0);
    Splat s = splats[n];
    float8 sum = 0;
    int2 across = 0, down = 0;
    if (s.drawn) {
        across = blocks_within(s.x, s.reach_x, BLOCK, (width + BLOCK - 1) / BLOCK);
        down = blocks_within(s.y, s.reach_y, BLOCK, (height + BLOCK - 1) / BLOCK);
    }
    for (int row = down.x; row < down.y; row++) {
        for (int column = across.x; column < across.y; column++) {
            float2 first = (float2)(column * BLOCK, row * BLOCK);
            if (!touches(s, first, first + (BLOCK - 1)))
                continue;                   /* all lanes agree; the box of a leaning needle is nearly empty */
            uint i = column * BLOCK + get_local_id(0), j = row * BLOCK + get_local_id(1);
            float2 u = whitened(s, i, j);
            float m = squared_distance(u);
            if (m <= SUPPORT_SQUARED && i < width && j < height) {  /* e is not read elsewhere: 0 inf is not 0 */
                global const float *e = residual + 3 * ((size_t)j * width + i);
                float g = weight(m);
                float q = g * (e[0] * s.red + e[1] * s.green + e[2] * s.blue);      /* (10-6) */
                sum += (float8)(q * u.x, q * u.y, q * u.x * u.x, q * u.x * u.y, q * u.y * u.y,
                                g * e[0], g * e[1], g * e[2]);
            }
        }
    }
    sums[lane] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint half_of = BLOCK * BLOCK / 2; half_of > 0; half_of /= 2) {
        if (lane < half_of)
            sums[lane] += sums[lane + half_of];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (lane == 0) {
        float8 S = sums[0];                 /* u1, u2, u1 u1, u1 u2, u2 u2, then red, green, blue */
        float r1 = s.drawn ? s.r1 : 0, r2 = s.drawn ? s.r2 : 0;     /* no 0 inf for a degenerate splat */
        float shear = s.drawn ? slope(s) : 0;
        global float *gradient = gradients + 8 * n;
        gradient[0] = S.s0 * r1 - shear * S.s1;                     /* (13-12), which is (10-7) and (10-8) */
        gradient[1] = S.s1 * r2;
        gradient[2] = S.s2 * r1 - shear * S.s3;
        gradient[3] = S.s3 * r2;
        gradient[4] = S.s4 * r2;
        gradient[5] = S.s5;                                         /* (10-9) */
        gradient[6] = S.s6;
        gradient[7] = S.s7;
    }
}

/* A splat as the renderer wants it, where it lies from a pixel, and whether it can reach a rectangle of pixels.

   All kernels are compiled twice from the same text. With EXACT nothing is fused, quotients are correctly rounded and
   subnormal numbers are kept: the same bytes on every device (spec.md 3.3, 9.3). Without, the compiler may fuse. Neither is
   ever compiled with -cl-fast-relaxed-math or -cl-finite-math-only, which fold the tests for NaN away (9.1), nor with
   -cl-mad-enable, whose mad may be less accurate than the error model (13-3). */

#ifdef EXACT
#pragma OPENCL FP_CONTRACT OFF
#else
#pragma OPENCL FP_CONTRACT ON
#endif

/* OpenCL lets a quotient of floats be 2.5 units off unless the device can do better and is told to. One of doubles is
   correctly rounded, and to round such a one again to a float does no harm. */
#ifdef DIVIDE_IN_BINARY64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define QUOTIENT(a, b) ((float)((double)(a) / (double)(b)))
#else
#define QUOTIENT(a, b) ((a) / (b))
#endif

#define LANES (TILE * TILE)                 /* work-items of a group in one dimension */

#define SMALLEST_NORMAL 0x1p-126f           /* l11 or l22 below it is degenerate (9.1) */
#define SUPPORT_SQUARED 0x1.62a41p+3f       /* K of (9-5): 2 ln 255, where a splat ends */
#define REACH 0x1.aa1ef0p+1f                /* rho' of section 5, rounded up */

/* sqrt may be 3 units off in OpenCL, more than (13-3) has for it: one step of Newton's method after it. */
float root(float a)
{
    float estimate = sqrt(a);
    return estimate > 0 && estimate < INFINITY ? estimate + fma(-estimate, estimate, a) / (2 * estimate) : estimate;
}

typedef struct {
    float x, y;
    float r1, r2;                           /* 1 / l11, 1 / l22 */
    float l, f;                             /* the shear of (9-3) in two factors, whose product is l21 / l22 */
    float reach_x, reach_y;                 /* half the size of the box: rho' l11, rho' (|l21| + l22) */
    float red, green, blue;
    int drawn;                              /* 0: degenerate, covers nothing */
} Splat;

/* One work-item for each splat: what does not depend on the pixel. */
kernel void prepare(global const float *parameters, uint splat_count, global Splat *splats)
{
    uint n = get_global_id(0);
    if (n >= splat_count)
        return;
    global const float *p = parameters + 8 * (size_t)n;
    float l11 = p[2], l21 = p[3], l22 = p[4];
    Splat s;
    s.x = p[0];
    s.y = p[1];
    s.r1 = QUOTIENT(1, l11);
    s.r2 = QUOTIENT(1, l22);
    s.l = l22 <= 1 ? l21 : QUOTIENT(l21, l22);     /* (9-3) */
    s.f = l22 <= 1 ? s.r2 : 1;
    s.reach_x = REACH * l11;
    s.reach_y = REACH * (fabs(l21) + l22);
    s.red = p[5];
    s.green = p[6];
    s.blue = p[7];
    s.drawn = l11 >= SMALLEST_NORMAL && l22 >= SMALLEST_NORMAL && l11 < INFINITY && l22 < INFINITY;
    splats[n] = s;
}

/* u of (9-4): from the splat's centre to that of pixel (i, j) in standard deviations. The difference of positions comes
   first: it is exact or nearly so, and whatever is rounded before it is lost (13.3). */
float2 whitened(Splat s, float i, float j)
{
    float u1 = ((i + 0.5f) - s.x) * s.r1;
    float u2 = ((j + 0.5f) - s.y) * s.r2 - (s.l * u1) * s.f;
    return (float2)(u1, u2);
}

/* m of (9-4), which is 2 sigma. A splat covers the pixel if m <= SUPPORT_SQUARED, which fails if m is NaN. */
float squared_distance(float2 u)
{
    return u.x * u.x + u.y * u.y;
}

/* exp(-m / 2) for m from 0 to SUPPORT_SQUARED. */
float weight(float m)
{
#ifdef EXACT
    float t = m * m;                        /* (9-5) */
    float p = ((-0x1.908c68p-28f * t + (0x1.498f3ep-21f * m + -0x1.547a8p-15f)) * t
               + (0x1.fff2fp-10f * m + -0x1.ffffc8p-5f)) * m + 1;
    float h = p * p;
    float q = h * h;
    return q * q;
#else
    return exp(-0.5f * m);                  /* not native_exp, whose error OpenCL leaves open */
#endif
}

/* Whether a splat may cover a pixel of the columns first.x..last.x and rows first.y..last.y, both included.

   This is (9-4) at the corners. Rounding is monotone: what rounded operations give at the corners encloses what the same
   operations give at every pixel between them, so no pixel is lost, not even of splats whose edges binary32 cannot
   place. (Where the compiler fuses, it may do so here and not there; that is a rounding, which (13-9) allows.)
   A NaN, from steps that overflow at a corner, fails each comparison below, and so keeps the splat. */
bool touches(Splat s, float2 first, float2 last)
{
    if (!s.drawn)
        return false;
    float u1_low = ((first.x + 0.5f) - s.x) * s.r1;
    float u1_high = ((last.x + 0.5f) - s.x) * s.r1;
    float shear_a = (s.l * u1_low) * s.f;
    float shear_b = (s.l * u1_high) * s.f;
    float u2_low = ((first.y + 0.5f) - s.y) * s.r2 - fmax(shear_a, shear_b);
    float u2_high = ((last.y + 0.5f) - s.y) * s.r2 - fmin(shear_a, shear_b);
    float2 nearest;
    nearest.x = u1_low > 0 ? u1_low : u1_high < 0 ? u1_high : 0;
    nearest.y = u2_low > 0 ? u2_low : u2_high < 0 ? u2_high : 0;
    return !(squared_distance(nearest) > SUPPORT_SQUARED);
}

/* The blocks of `size` pixels, first and end, that a box of half size `reach` around a centre may touch, out of `count`.
   Its edges are rounded, by far more than a pixel if the splat is far away: `slack` is wider than that; `touches` sorts
   out what is too much. Clamped before the conversion to integers, which is undefined for large numbers. */
int2 blocks_within(float centre, float reach, int size, int count)
{
    float slack = (fabs(centre) + reach) * 0x1p-21f + 1;
    float first = floor((centre - reach - slack) / size);
    float end = ceil((centre + reach + slack) / size);
    return (int2)((int)clamp(first, 0.0f, (float)count), (int)clamp(end, 0.0f, (float)count));
}

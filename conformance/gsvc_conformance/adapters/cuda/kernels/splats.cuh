/* A splat as the renderer wants it, where it lies from a pixel, and whether it can reach a rectangle of pixels. */

#pragma once

#include "common.cuh"

#define SMALLEST_NORMAL 0x1p-126f           /* l11 or l22 below it is degenerate (9.1) */
#define REACH 0x1.aa1ef0p+1f                /* rho' of section 5, rounded up */

/* Where nothing asks for identical bytes, u is in a unit of UNIT in which the weight is 2^-m: a product less for each. */
#ifdef EXACT
#define UNIT 1.0f
#define SUPPORT_SQUARED 0x1.62a41p+3f       /* K of (9-5): 2 ln 255, where a splat ends */
#else
#define UNIT 0.8493218f                     /* the root of 1 / (2 ln 2) */
#define SUPPORT_SQUARED 7.9943534f          /* log2 255 */
#endif

struct __align__(16) Splat {
    float x, y;
    float r1, r2;                           /* 1 / l11 and 1 / l22, times UNIT */
    float l, f;                             /* the shear of (9-3) in two factors, whose product is l21 / l22 */
    float reach_x, reach_y;                 /* half the size of the box: rho' l11, rho' (|l21| + l22) */
    float red, green, blue;
    int slot;                               /* where its moments begin in gradients.cu, less than 0 for nowhere */
};

static __device__ __forceinline__ bool is_drawn(const float *parameters)
{
    float l11 = parameters[2], l22 = parameters[4];
    return l11 >= SMALLEST_NORMAL && l22 >= SMALLEST_NORMAL && l11 < INFINITY && l22 < INFINITY;
}

/* What does not depend on the pixel. */
static __device__ __forceinline__ Splat project(const float *parameters)
{
    float l11 = parameters[2], l21 = parameters[3], l22 = parameters[4];
    Splat s;
    s.x = parameters[0];
    s.y = parameters[1];
    s.r1 = __fdiv_rn(UNIT, l11);
    s.r2 = __fdiv_rn(UNIT, l22);
    s.l = l22 <= 1 ? l21 : __fdiv_rn(l21, l22);        /* (9-3) */
    s.f = l22 <= 1 ? __fdiv_rn(1, l22) : 1.0f;
    s.reach_x = REACH * l11;
    s.reach_y = REACH * (fabsf(l21) + l22);
    s.red = parameters[5];
    s.green = parameters[6];
    s.blue = parameters[7];
    s.slot = -1;
    return s;
}

/* u1 of (9-4) in a column of pixels with its centre at `column`, and (l u1) f. */
static __device__ __forceinline__ float whitened_column(const Splat &s, float column)
{
    return __fmul_rn(__fsub_rn(column, s.x), s.r1);
}

static __device__ __forceinline__ float shear(const Splat &s, float u1)
{
    return __fmul_rn(__fmul_rn(s.l, u1), s.f);
}

/* u2 of (9-4) in a row with its centre at `row`. */
static __device__ __forceinline__ float whitened_row(const Splat &s, float row, float sheared)
{
    return multiply_add(__fsub_rn(row, s.y), s.r2, -sheared);
}

/* 2^a to 2 ulp. What it flushes does not matter: weights are from 1/255 to 1. */
static __device__ __forceinline__ float exp2_approximately(float a)
{
#ifdef FIBERS
    return exp2f(a);
#else
    float power;
    asm("ex2.approx.ftz.f32 %0, %1;" : "=f"(power) : "f"(a));
    return power;
#endif
}

/* The weight of a splat for m from 0 to SUPPORT_SQUARED; of another m it is any number. */
static __device__ __forceinline__ float exp_minus_half(float m)
{
#ifdef EXACT
    float t = __fmul_rn(m, m);              /* (9-5) */
    float high = multiply_add(-0x1.908c68p-28f, t, multiply_add(0x1.498f3ep-21f, m, -0x1.547a8p-15f));
    float low = multiply_add(0x1.fff2fp-10f, m, -0x1.ffffc8p-5f);
    float p = multiply_add(multiply_add(high, t, low), m, 1.0f);
    float h = __fmul_rn(p, p);
    float q = __fmul_rn(h, h);
    return __fmul_rn(q, q);
#else
    return exp2_approximately(-m);
#endif
}

/* Whether a splat may cover a pixel of the rectangle whose first and last centres these are.

   These are the operations of (9-4) at the corners. Rounding keeps the order: what they give at the corners encloses what
   they give at every pixel between, so no pixel is lost, not even of splats whose edges binary32 cannot place. (Where the
   compiler fuses, it may do so here and not there; that is a rounding, which (13-9) allows.) A NaN, from steps that
   overflow at a corner, keeps the splat. */
static __device__ __forceinline__ bool touches(const Splat &s, float left, float right, float top, float bottom)
{
    float u1_left = whitened_column(s, left), u1_right = whitened_column(s, right);
    float shear_left = shear(s, u1_left), shear_right = shear(s, u1_right);
    float a = whitened_row(s, top, shear_left), b = whitened_row(s, top, shear_right);
    float c = whitened_row(s, bottom, shear_left), d = whitened_row(s, bottom, shear_right);
    float low = fminf(fminf(a, b), fminf(c, d)), high = fmaxf(fmaxf(a, b), fmaxf(c, d));
    float u1 = u1_left > 0 ? u1_left : u1_right < 0 ? u1_right : 0.0f;
    float u2 = low > 0 ? low : high < 0 ? high : 0.0f;
    float nearest = multiply_add(u2, u2, __fmul_rn(u1, u1));
    float any_nan = u1_left + u1_right + (a + b) + (c + d);
    return !(nearest > SUPPORT_SQUARED) || any_nan != any_nan;
}

#define BLOCK 32                            /* width and height of what a block of threads draws, in pixels */

/* Columns and rows of squares of `side` pixels. */
struct Box { int left, top, columns, rows; };

static __device__ __forceinline__ int2 squares_within(float centre, float reach, int side, int count)
{
    float slack = (fabsf(centre) + reach) * 0x1p-21f + 1;   /* wider than what is rounded here; `touches` sorts it out */
    float first = floorf((centre - reach - slack) / side), end = ceilf((centre + reach + slack) / side);
    return make_int2((int)fminf(fmaxf(first, 0.0f), count), (int)fminf(fmaxf(end, 0.0f), count));
}

/* The squares that the box of a splat may touch, of a frame of so many pixels. */
static __device__ __forceinline__ Box box_of(const Splat &s, int side, int width, int height)
{
    int2 across = squares_within(s.x, s.reach_x, side, (width + side - 1) / side);
    int2 down = squares_within(s.y, s.reach_y, side, (height + side - 1) / side);
    return {across.x, down.x, max(across.y - across.x, 0), max(down.y - down.x, 0)};
}

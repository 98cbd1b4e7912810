/* dL/dparameters of splats from dL/dC of pixels (10.3), coverage held fixed.

   A tile adds up eight numbers for each of its splats: the moments of (13-12) and (10-9). They have no factor of the splat
   in them, so that nothing underflows before the end. A splat has a slot for each block of its box, with room for the
   moments of four tiles, and nobody else writes there; in the end a warp for each splat adds up its slots, in binary64 and
   always in the same order. So a gradient has the same bytes in every run, and no atomic addition flushes any of it. */

#define ROWS 8
#include "sums.cuh"

#define MOMENTS 8
#define SPLATS_OF_BLOCK 8

/* Half of `count` numbers of a lane go to the lane across; both add what they get. */
template <int COUNT> static __device__ __forceinline__ void fold(float *numbers, int across)
{
    bool upper = threadIdx.x & across;
#pragma unroll
    for (int k = 0; k < COUNT / 2; k++) {
        float given = upper ? numbers[k] : numbers[k + COUNT / 2], kept = upper ? numbers[k + COUNT / 2] : numbers[k];
        numbers[k] = kept + __shfl_xor_sync(EVERY_LANE, given, across);
    }
}

/* Sums over the warp of eight numbers of each lane; lane l gets that of number l / 4. */
static __device__ __forceinline__ float sum_of_warp(float *numbers)
{
    fold<8>(numbers, 16);
    fold<4>(numbers, 8);
    fold<2>(numbers, 4);
    float sum = numbers[0] + __shfl_xor_sync(EVERY_LANE, numbers[0], 2);
    return sum + __shfl_xor_sync(EVERY_LANE, sum, 1);
}

/* The moments of a splat over a tile, for e = dL/dC: of u1, u2, u1 u1, u1 u2, u2 u2, then red, green, blue. */
static __device__ __forceinline__ float grad_add_splat(const Splat &s, const Tile &tile, const Sums &e)
{
    float u1 = whitened_column(s, tile.i + 0.5f), sheared = shear(s, u1), square = __fmul_rn(u1, u1);
    float q_u2 = 0, q_u2_u2 = 0, red = 0, green = 0, blue = 0;
#pragma unroll
    for (int k = 0; k < ROWS; k++) {
        float u2 = whitened_row(s, tile.j + 0.5f + 4 * k, sheared);
        float m = multiply_add(u2, u2, square);
        float g = exp_minus_half(m);
        if (m <= SUPPORT_SQUARED) {
            float q = g * (e.red[k] * s.red + e.green[k] * s.green + e.blue[k] * s.blue);      /* (10-6) */
            float by_u2 = q * u2;
            q_u2 += by_u2;
            q_u2_u2 += by_u2 * u2;
            red += g * e.red[k];
            green += g * e.green[k];
            blue += g * e.blue[k];
        }
    }
    u1 = fabsf(u1) < INFINITY ? u1 : 0.0f;  /* where it is not finite nothing is covered, and 0 inf is not 0 */
    float q_u1 = (red * s.red + green * s.green + blue * s.blue) * u1;     /* the sum of q times u1, that of the column */
    float moments[MOMENTS] = {q_u1, q_u2, q_u1 * u1, q_u2 * u1, q_u2_u2, red, green, blue};
    return sum_of_warp(moments);
}

/* Fills the slots of the splats of the block's region, for e at the pixels of this lane. */
static __device__ __forceinline__ void write_moments(const Scene &scene, const Tile &tile, const Sums &e, float *moments)
{
    int lane = threadIdx.x % 32, warp = threadIdx.x / 32;
    auto place = [=](const Splat &s) { return moments + ((size_t)s.slot * WARPS + warp) * MOMENTS; };
    each_splat(
        scene, tile,
        [&](const Splat &s) {
            float sum = grad_add_splat(s, tile, e);
            if (s.slot >= 0 && lane % 4 == 0)
                place(s)[lane / 4] = sum;
        },
        [&](const Splat &s) {
            float4 *zeros = (float4 *)place(s);
            if (s.slot >= 0)
                zeros[0] = zeros[1] = make_float4(0, 0, 0, 0);
        });
}

extern "C" __global__ void __launch_bounds__(THREADS, 6)
render_gradients(Scene scene, const float *residual, float *moments)
{
    Tile tile = tile_of_warp(scene);
    write_moments(scene, tile, read_pixels(scene, tile, residual), moments);
}

/* clamp(C) - F, which is e of (10-2) but for its factor; the sum of its squares over the warp goes to `losses`. */
static __device__ __forceinline__ Sums differences(const Scene &scene, const Tile &tile, const Sums &sums, const float *target,
                                                   double *losses)
{
    Sums e = read_pixels(scene, tile, target);
    double squares = 0;
#pragma unroll
    for (int k = 0; k < ROWS; k++) {
        bool there = is_pixel(scene, tile, k);
        e.red[k] = there ? fminf(fmaxf(sums.red[k], 0.0f), 1.0f) - e.red[k] : 0.0f;
        e.green[k] = there ? fminf(fmaxf(sums.green[k], 0.0f), 1.0f) - e.green[k] : 0.0f;
        e.blue[k] = there ? fminf(fmaxf(sums.blue[k], 0.0f), 1.0f) - e.blue[k] : 0.0f;
        squares += e.red[k] * e.red[k] + e.green[k] * e.green[k] + e.blue[k] * e.blue[k];
    }
    for (int across = 16; across > 0; across /= 2)
        squares += __shfl_xor_sync(EVERY_LANE, squares, across);
    if (threadIdx.x % 32 == 0)
        losses[tile.number] = squares;
    return e;
}

/* The picture of the splats on top of `base`, its differences from the target, and their moments: nothing but these leaves
   the registers. `base` may be null; if `picture` is not, it gets the sums. */
extern "C" __global__ void __launch_bounds__(THREADS, 6)
loss_and_gradients(Scene scene, const float *base, const float *target, double *losses, float *moments, float *picture)
{
    Tile tile = tile_of_warp(scene);
    Sums sums = sums_of(scene, tile, base);
    if (picture)
        write_pixels(scene, tile, sums, picture);
    write_moments(scene, tile, differences(scene, tile, sums, target, losses), moments);
}

/* The picture of the splats on top of `base`, and its differences from the target. */
extern "C" __global__ void __launch_bounds__(THREADS, 7)
loss_of_splats(Scene scene, const float *base, const float *target, double *losses, float *picture)
{
    Tile tile = tile_of_warp(scene);
    Sums sums = sums_of(scene, tile, base);
    if (picture)
        write_pixels(scene, tile, sums, picture);
    differences(scene, tile, sums, target, losses);
}

/* One warp for each splat: its gradient, times `scale`, from its slots. Lane l adds number l % 8 of tile l / 8. Without
   slots, which the host has to see in `slots_needed` of lists.cu, a gradient is NaN. */
extern "C" __global__ void __launch_bounds__(32 * SPLATS_OF_BLOCK)
grad_splats(Scene scene, const float *parameters, int splat_count, const float *moments, double scale, float *gradients)
{
    int n = blockIdx.x * SPLATS_OF_BLOCK + threadIdx.x / 32, lane = threadIdx.x % 32;
    if (n >= splat_count)
        return;
    parameters += 8 * (size_t)n;
    Splat s = scene.splats[n];
    Box box = is_drawn(parameters) ? box_of(s, BLOCK, scene.width, scene.height) : Box{0, 0, 0, 0};
    const unsigned *lists = (const unsigned *)scene.lists;
    double sum = 0;
    for (int first = 0; first < box.columns * box.rows; first += 32) {
        int k = first + lane;
        bool listed = false;
        if (k < box.columns * box.rows) {
            int column = (box.left + k % box.columns) * BLOCK / scene.side;
            int row = (box.top + k / box.columns) * BLOCK / scene.side;
            size_t region = (size_t)row * scene.columns + column;
            listed = lists[region * scene.list_size * 4 + n / 32] >> n % 32 & 1;
        }
        for (unsigned rest = __ballot_sync(EVERY_LANE, listed); rest != 0; rest &= rest - 1) {
            int slot = s.slot + first + __ffs(rest) - 1;
            sum += s.slot >= 0 ? moments[(size_t)slot * (WARPS * MOMENTS) + lane] : NAN;
        }
    }
    sum += __shfl_xor_sync(EVERY_LANE, sum, 8);
    sum += __shfl_xor_sync(EVERY_LANE, sum, 16);
    double next = __shfl_down_sync(EVERY_LANE, sum, 1);
    double r1 = 1 / (UNIT * (double)parameters[2]), r2 = 1 / (UNIT * (double)parameters[4]);
    double across = UNIT * r1 * r2 * parameters[3];
    double gradient = lane == 0 || lane == 2 ? sum * r1 - next * across : lane < 5 ? sum * r2 : sum;    /* (13-12), (10-9) */
    gradient *= lane >= 2 && lane < 5 ? 1 / (double)UNIT : 1;                           /* a second u */
    if (lane < MOMENTS)
        gradients[8 * (size_t)n + lane] = is_drawn(parameters) ? (float)(scale * gradient) : 0.0f;
}

/* One block: the loss, whose parts are added in a fixed order; with it, for one download, the slots that there should have
   been, unless nobody asks. */
extern "C" __global__ void __launch_bounds__(256)
add_losses(const double *losses, int count, double scale, const unsigned long long *slots_needed, double *told)
{
    double own = 0;
    for (int k = threadIdx.x; k < count; k += 256)
        own += losses[k];
    own = sum_of_block<8>(own);
    if (threadIdx.x == 0) {
        told[0] = own * scale;
        if (slots_needed)
            told[1] = (double)*slots_needed;
    }
}

/* What a lane adds up at its pixels. */

#pragma once

#include "tiles.cuh"

/* Three numbers of each pixel of a lane, such as C of (9-2). */
struct Sums { float red[ROWS], green[ROWS], blue[ROWS]; };

/* (9-2), and in the order in which it is called (9-6). All rows are looked at, without a branch: a splat that touches a tile
   covers most of them. */
static __device__ __forceinline__ void add_splat(const Splat &s, const Tile &tile, Sums &sums)
{
    float u1 = whitened_column(s, tile.i + 0.5f), sheared = shear(s, u1), square = __fmul_rn(u1, u1);
#pragma unroll
    for (int k = 0; k < ROWS; k++) {
        float u2 = whitened_row(s, tile.j + 0.5f + 4 * k, sheared);
        float m = multiply_add(u2, u2, square);
        float g = exp_minus_half(m);
        if (m <= SUPPORT_SQUARED) {
            sums.red[k] = multiply_add(g, s.red, sums.red[k]);
            sums.green[k] = multiply_add(g, s.green, sums.green[k]);
            sums.blue[k] = multiply_add(g, s.blue, sums.blue[k]);
        }
    }
}

static __device__ __forceinline__ bool is_pixel(const Scene &scene, const Tile &tile, int k)
{
    return tile.i < scene.width && tile.j + 4 * k < scene.height;
}

/* Where the three components of the k-th pixel of a lane begin. */
static __device__ __forceinline__ size_t place_of(const Scene &scene, const Tile &tile, int k)
{
    return 3 * ((size_t)(tile.j + 4 * k) * scene.width + tile.i);
}

/* The pixels of a lane in a picture; 0 beyond its edges, and where there is no picture. */
static __device__ __forceinline__ Sums read_pixels(const Scene &scene, const Tile &tile, const float *picture)
{
    Sums pixels;
#pragma unroll
    for (int k = 0; k < ROWS; k++) {
        bool there = picture && is_pixel(scene, tile, k);
        const float *pixel = picture + place_of(scene, tile, k);
        pixels.red[k] = there ? pixel[0] : 0.0f;
        pixels.green[k] = there ? pixel[1] : 0.0f;
        pixels.blue[k] = there ? pixel[2] : 0.0f;
    }
    return pixels;
}

static __device__ __forceinline__ void write_pixels(const Scene &scene, const Tile &tile, const Sums &pixels, float *picture)
{
#pragma unroll
    for (int k = 0; k < ROWS; k++)
        if (is_pixel(scene, tile, k)) {
            float *pixel = picture + place_of(scene, tile, k);
            pixel[0] = pixels.red[k];
            pixel[1] = pixels.green[k];
            pixel[2] = pixels.blue[k];
        }
}

/* The sums of the splats on top of a picture, `base`, or of nothing. */
static __device__ __forceinline__ Sums sums_of(const Scene &scene, const Tile &tile, const float *base)
{
    Sums sums = read_pixels(scene, tile, base);
    each_splat(scene, tile, [&](const Splat &s) { add_splat(s, tile, sums); }, [](const Splat &) {});
    return sums;
}

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

template <class T> struct alignas(4 * sizeof(T)) Four { T components[4]; };

/* The components of a tile, row by row, from shared memory into the picture, a unit at a time. */
template <class Unit, class T>
static __device__ __forceinline__ void copy_rows(const Scene &scene, const Tile &tile, const T *rows, T *picture)
{
    const int size = sizeof(Unit) / sizeof(T), units_of_row = 3 * TILE_WIDTH / size;
#pragma unroll 1
    for (int at = threadIdx.x % 32; at < TILE_HEIGHT * units_of_row; at += 32) {
        int row = tile.y + at / units_of_row, component = 3 * tile.x + at % units_of_row * size;
        if (row < scene.height && component < 3 * scene.width)
            *(Unit *)(picture + 3 * (size_t)row * scene.width + component) = ((const Unit *)rows)[at];
    }
}

/* Writes convert(number) for each number of the pixels of a warp: by way of shared memory, so that lanes side by side write
   side by side, four components each where every row of the picture begins at a multiple of four. */
template <class T, class Convert>
static __device__ __forceinline__ void write_pixels(const Scene &scene, const Tile &tile, const Sums &pixels, T *picture,
                                                    Convert convert)
{
    __shared__ Four<T> rows[WARPS][3 * TILE_WIDTH * TILE_HEIGHT / 4];
    T *own = rows[threadIdx.x / 32][0].components;
#pragma unroll
    for (int k = 0; k < ROWS; k++) {
        T *pixel = own + 3 * (32 * k + threadIdx.x % 32);
        pixel[0] = convert(pixels.red[k]);
        pixel[1] = convert(pixels.green[k]);
        pixel[2] = convert(pixels.blue[k]);
    }
    __syncwarp();
    if (scene.width % 4 == 0)
        copy_rows<Four<T>>(scene, tile, own, picture);
    else
        copy_rows<T>(scene, tile, own, picture);
}

static __device__ __forceinline__ void write_pixels(const Scene &scene, const Tile &tile, const Sums &pixels, float *picture)
{
    write_pixels(scene, tile, pixels, picture, [](float sum) { return sum; });
}

/* The sums of the splats on top of a picture, `base`, or of nothing. */
static __device__ __forceinline__ Sums sums_of(const Scene &scene, const Tile &tile, const float *base)
{
    Sums sums = read_pixels(scene, tile, base);
    each_splat(scene, tile, [&](const Splat &s) { add_splat(s, tile, sums); }, [](const Splat &) {});
    return sums;
}

/* From lists of regions to the splats of a tile.

   A block of threads has a square of BLOCK x BLOCK pixels, each of its warps a tile of 8 x 4 ROWS, and each lane ROWS pixels
   of a column of it, every fourth: so what a warp does at once is in 8 x 4 pixels, and of these a splat covers most or none.
   The list of a region is a bit for each splat of the frame: that keeps their order without a sort, and the block turns it
   into numbers as it goes. Nothing limits the number of splats of a tile (9.1).

   Who includes this defines ROWS, 4 or 8: more of them share what is done once for a splat and a column, fewer are sooner
   at their end. */

#pragma once

#include "splats.cuh"

#define TILE_WIDTH 8
#define TILE_HEIGHT (4 * ROWS)
#define WARPS (BLOCK / TILE_WIDTH * (BLOCK / TILE_HEIGHT))
#define THREADS (32 * WARPS)

/* Frame, splats and lists. */
struct Scene {
    const Splat *splats;
    const uint4 *lists;                     /* of one region after the other, `list_size` times 128 bits each */
    int list_size;
    int width, height;
    int side, columns;                      /* width and height of a region in pixels, a multiple of BLOCK; regions across */
};

/* The tile of a warp, and the pixels of a lane in it: column i, rows j, j + 4, ..., j + 4 (ROWS - 1). */
struct Tile {
    int number;                             /* in the order of blocks and warps */
    int x, y;                               /* its first column and row */
    bool inside;                            /* whether it has pixels of the frame */
    float left, right, top, bottom;         /* its first and last centres */
    int i, j;
};

static __device__ __forceinline__ Tile tile_of_warp(const Scene &scene)
{
    int lane = threadIdx.x % 32, warp = threadIdx.x / 32;
    Tile tile;
    tile.x = blockIdx.x * BLOCK + warp % (BLOCK / TILE_WIDTH) * TILE_WIDTH;
    tile.y = blockIdx.y * BLOCK + warp / (BLOCK / TILE_WIDTH) * TILE_HEIGHT;
    tile.number = (blockIdx.y * gridDim.x + blockIdx.x) * WARPS + warp;
    tile.inside = tile.x < scene.width && tile.y < scene.height;
    tile.left = tile.x + 0.5f;
    tile.right = min(tile.x + TILE_WIDTH, scene.width) - 0.5f;
    tile.top = tile.y + 0.5f;
    tile.bottom = min(tile.y + TILE_HEIGHT, scene.height) - 0.5f;
    tile.i = tile.x + lane % TILE_WIDTH;
    tile.j = tile.y + lane / TILE_WIDTH;
    return tile;
}

/* The slot for what this block finds out about a splat: a splat has one for each block of its box. */
static __device__ __forceinline__ int slot_of_block(const Splat &s, const Scene &scene)
{
    Box box = box_of(s, BLOCK, scene.width, scene.height);
    int column = blockIdx.x - box.left, row = blockIdx.y - box.top;
    bool within = column >= 0 && column < box.columns && row >= 0 && row < box.rows;
    return s.slot >= 0 && within ? s.slot + row * box.columns + column : -1;
}

/* Calls add(splat) for the splats that touch the tile, in ascending order, and skip(splat) in some lanes for others of its
   region: all lanes of a warp call `add` together, and all threads of the block have to take part. */
template <class Add, class Skip>
static __device__ __forceinline__ void each_splat(const Scene &scene, const Tile &tile, Add add, Skip skip)
{
    __shared__ Splat staged[THREADS];
    __shared__ int numbers[THREADS];
    int t = threadIdx.x, lane = t % 32, count = 0;

    auto use_staged = [&] {
        __syncthreads();                    /* nobody is at the splats before these any more */
        if (t < count) {
            Splat s = scene.splats[numbers[t]];
            s.slot = slot_of_block(s, scene);
            staged[t] = s;
        }
#ifndef PLANTED_RACE
        __syncthreads();
#endif
        for (int first = 0; first < count; first += 32) {
            bool there = first + lane < count;
            const Splat &mine = staged[first + lane];
            bool hit = there && tile.inside && touches(mine, tile.left, tile.right, tile.top, tile.bottom);
            if (there && !hit)
                skip(mine);
            for (unsigned hits = __ballot_sync(EVERY_LANE, hit); hits != 0; hits &= hits - 1) {
                Splat next = staged[first + __ffs(hits) - 1];
                add(next);
            }
        }
    };

    size_t region = (size_t)(blockIdx.y * BLOCK / scene.side) * scene.columns + blockIdx.x * BLOCK / scene.side;
    const uint4 *list = scene.lists + region * scene.list_size;
    for (int first = 0; first < scene.list_size; first += THREADS) {
        uint4 bits = first + t < scene.list_size ? list[first + t] : make_uint4(0, 0, 0, 0);
        unsigned words[4] = {bits.x, bits.y, bits.z, bits.w};
        int total, before = sum_before<WARPS>(__popc(bits.x) + __popc(bits.y) + __popc(bits.z) + __popc(bits.w), &total);
        for (int taken = 0; taken < total;) {
            int place = count + before - taken;         /* of the first splat of this thread's bits */
            for (int k = 0; k < 4; k++)
                for (unsigned rest = words[k]; rest != 0; rest &= rest - 1, place++)
                    if (place >= count && place < THREADS)
                        numbers[place] = ((first + t) * 4 + k) * 32 + __ffs(rest) - 1;
            int fit = min(THREADS - count, total - taken);
            taken += fit;
            count += fit;
            if (count == THREADS) {
                use_staged();
                count = 0;
            }
        }
    }
    use_staged();
}

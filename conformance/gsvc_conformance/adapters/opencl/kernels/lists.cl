/* Which splats touch which region of the frame, in ascending order, without atomics and without sorting.

   The frame is divided into regions in steps: large ones, then smaller ones inside, down to the tiles of render.cl. In each
   step a region goes through the list of the region around it and takes the splats that touch it:

       count_touching    how many each region takes
       scan              where the list of each region begins
       write_touching    the lists

   A list keeps the order of the one that it is taken from, and that at the top is 0..N-1: so (9-6) can be summed in its
   order. Counting first costs a second test of each splat and gives lists of exactly the size needed. */

typedef struct {
    uint width, height;                     /* of the frame */
    uint side;                              /* of a region, in pixels */
    uint columns;                           /* regions side by side */
    uint first_row;                         /* the row of regions where the band begins that is listed */
    uint parent_side, parent_columns, parent_first_row;     /* the same of the regions around these */
} Grid;

/* Sum of `value` over the lanes of the work-group before this one; `total` gets that over all. */
uint sum_before(uint value, local uint *sums, uint *total)
{
    uint lane = get_local_id(0);
    sums[lane] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint step = 1; step < LANES; step *= 2) {
        uint before = lane >= step ? sums[lane - step] : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        sums[lane] += before;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    uint through = sums[lane];
    *total = sums[LANES - 1];
    barrier(CLK_LOCAL_MEM_FENCE);
    return through - value;
}

/* One work-group for all: start[k] is the sum of count[0..k-1], start[n] that of all, in 64 bits. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void scan(global const uint *count, uint n, global ulong *start)
{
    local uint sums[LANES];
    uint lane = get_local_id(0);
    ulong carried = 0;
    for (uint first = 0; first < n; first += LANES) {
        uint total, at = first + lane;
        uint before = sum_before(at < n ? count[at] : 0, sums, &total);
        if (at < n)
            start[at] = carried + before;
        carried += total;
    }
    if (lane == 0)
        start[n] = carried;
}

/* The list at the top: every splat. */
kernel void list_all(uint splat_count, global uint *list, global ulong *start)
{
    uint n = get_global_id(0);
    if (n < splat_count)
        list[n] = n;
    if (n == 0) {
        start[0] = 0;
        start[1] = splat_count;
    }
}

/* Whether a splat touches the region with this number. */
bool in_region(Splat splat, Grid grid, uint region)
{
    uint column = region % grid.columns, row = grid.first_row + region / grid.columns;
    float2 first = (float2)(column * grid.side, row * grid.side);
    float2 last = (float2)(min((column + 1) * grid.side, grid.width) - 1, min((row + 1) * grid.side, grid.height) - 1);
    return touches(splat, first, last);
}

uint region_around(Grid grid, uint region)
{
    uint column = region % grid.columns, row = grid.first_row + region / grid.columns;
    uint parent_row = row * grid.side / grid.parent_side - grid.parent_first_row;
    return parent_row * grid.parent_columns + column * grid.side / grid.parent_side;
}

/* One work-group for each region: the lanes look at LANES splats at a time. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void count_touching(global const Splat *splats, global const uint *parent_list, global const ulong *parent_start, Grid grid,
                    global uint *count)
{
    local uint hits[LANES];
    uint lane = get_local_id(0), region = get_group_id(0), parent = region_around(grid, region);
    uint taken = 0;
    for (ulong at = parent_start[parent] + lane; at < parent_start[parent + 1]; at += LANES)
        taken += in_region(splats[parent_list[at]], grid, region);
    hits[lane] = taken;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint half_of = LANES / 2; half_of > 0; half_of /= 2) {
        if (lane < half_of)
            hits[lane] += hits[lane + half_of];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (lane == 0)
        count[region] = hits[0];
}

/* The same walk again: now the place of each splat is known, after those that lower lanes and earlier rounds took. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void write_touching(global const Splat *splats, global const uint *parent_list, global const ulong *parent_start, Grid grid,
                    global const ulong *start, global uint *list)
{
    local uint sums[LANES];
    uint lane = get_local_id(0), region = get_group_id(0), parent = region_around(grid, region);
    ulong end = parent_start[parent + 1], place = start[region];
    for (ulong first = parent_start[parent]; first < end; first += LANES) {
        uint splat = first + lane < end ? parent_list[first + lane] : 0;
        uint hit = first + lane < end && in_region(splats[splat], grid, region), total;
        uint before = sum_before(hit, sums, &total);
        if (hit)
            list[place + before] = splat;
        place += total;
    }
}

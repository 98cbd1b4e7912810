/* Which splats leave and which come during training (10.7, 10.8). */

/* How many of the keys are below a limit; every lane gets it. */
uint count_below(global const uint *keys, uint count, uint limit, local uint *sums)
{
    uint own = 0, total;
    for (uint n = get_local_id(0); n < count; n += LANES)
        own += keys[n] < limit;
    sum_before(own, sums, &total);
    return total;
}

/* |w| as integers, which are in the same order; -0 is 0. */
kernel void prune_keys(global const float *weights, uint count, global uint *keys)
{
    uint n = get_global_id(0);
    if (n < count)
        keys[n] = as_uint(fabs(weights[n]));
}

/* R-10.7-2 without sorting; one work-group, since it is done once in a hundred iterations. First, bit by bit, the largest
   limit with no more than `removed` keys below it: these leave, and of those equal to it the last ones. Then those that
   stay are written in their order. */
kernel __attribute__((reqd_work_group_size(LANES, 1, 1)))
void prune(global const uint *keys, uint count, uint removed, global long *survivors)
{
    local uint sums[LANES];
    uint limit = 0;
    for (uint bit = 1u << 30; bit > 0; bit >>= 1)       /* keys have 31 bits */
        if (count_below(keys, count, limit | bit, sums) <= removed)
            limit |= bit;
    uint below = count_below(keys, count, limit, sums), equal = count_below(keys, count, limit + 1, sums) - below;
    uint equal_that_stay = equal - min(equal, removed - below), equal_seen = 0, place = 0;
    for (uint first = 0; first < count; first += LANES) {
        uint n = first + get_local_id(0), equal_here, staying;
        bool is_equal = n < count && keys[n] == limit;
        uint equal_before = equal_seen + sum_before(is_equal, sums, &equal_here);
        bool stays = n < count && (keys[n] > limit || (is_equal && equal_before < equal_that_stay));
        uint before = sum_before(stays, sums, &staying);
        if (stays)
            survivors[place + before] = n;
        equal_seen += equal_here;
        place += staying;
    }
}

/* R-10.7-3: one work-item for each number that is left. Not in place, since a row may be read after it was written over. */
kernel void compact(global const float *rows, global const long *survivors, uint columns, ulong count, global float *left)
{
    size_t at = get_global_id(0);
    if (at < count)
        left[at] = rows[survivors[at / columns] * columns + at % columns];
}

/* (10-26), (10-27): one work-item for each new splat. Exact. */
kernel void augment(global const float *uniforms, uint added, float width, float height, global float *values)
{
    uint n = get_global_id(0);
    if (n >= added)
        return;
    float8 a = vload8(n, uniforms);
    vstore8((float8)(a.s0 * width, a.s1 * height, a.s2 + 0.5f, a.s3, a.s4 + 0.5f, a.s567), 0, values + 9 * (size_t)n);
    values[9 * (size_t)n + 8] = 0.01f;
}

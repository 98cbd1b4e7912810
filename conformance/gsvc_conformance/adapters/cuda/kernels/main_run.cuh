/* Profile main: the run of a frame (spec.md 15.6), by one block. A warp decodes the symbols of a group of 32 lanes, which
   find their words by a ballot; raw values find their bits by a sum over the values before them. */

#pragma once

#include "blocks.cuh"
#include "main_tables.cuh"

#define MOST_LANES 4096
#define GROUP 32

/* The rules that a body can break; 0: none. reading.py has them in the same order. */
enum Rule {
    SOUND, R_6_2_2, R_6_2_3, R_3_2_1, R_15_5_1, R_15_5_2, R_15_5_5, R_3_1_1, R_5_2, R_5_9, R_15_5_3, R_15_5_4, R_3_1_4,
    R_6_6_5, R_15_6_5, R_7_1, R_5_4
};

/* What the threads share. */
struct Lanes {
    unsigned states[MOST_LANES];
    unsigned taken[MOST_LANES / GROUP];     /* the next word of each group */
    unsigned ends[MOST_LANES / GROUP + 1];  /* the first word of each group, and the one after the last */
};

/* Words and raw bits. */
struct RawBits {
    const unsigned char *text;              /* from the first word to the end of the payload */
    unsigned size;                          /* bytes of it */
    unsigned carried, early;                /* late bits in the final states; early bits before the others; or 0 and 0 */
};

/* A place in the run; all threads have the same. */
struct Run {
    RawBits raw;
    unsigned lanes, groups;
    unsigned pass, place, decoded;          /* the number of the pass; how many symbols it had; how many all had */
    unsigned at;                            /* the next raw bit, of the early ones or of the late ones */
    ushort4 *trace;                         /* what each symbol was: c(s), f(s), pass and lane; or null */
};

static __device__ __forceinline__ unsigned word_at(const Run &run, const Lanes &lanes, unsigned group, unsigned word)
{
    if (word >= lanes.ends[group + 1])
        return 0;                           /* a fault, which is found at the end */
    return run.raw.text[2 * word] | run.raw.text[2 * word + 1] << 8;
}

/* The next symbols of a pass. `prepare(i)` gets what symbol i depends on, all of it from passes before, and `read(i, that,
   slot)` finds the symbol and keeps what it says. Symbols are prepared, and words loaded, a round before they are needed:
   memory is far, and nothing but the states of the lanes has to be waited for. */
template <class Prepare, class Read>
__device__ void decode_symbols(Run &run, Lanes &lanes, unsigned count, Prepare prepare, Read read)
{
    unsigned of_group = threadIdx.x % GROUP, first_round = run.place / run.lanes, end = run.place + count;
    ROLLED for (unsigned group = threadIdx.x / GROUP; group < run.groups; group += blockDim.x / GROUP) {
        unsigned lane = group * GROUP + of_group, x = lane < run.lanes ? lanes.states[lane] : 0, word = lanes.taken[group];
        unsigned of_lane = lane < run.lanes ? count : 0;
        unsigned next = first_round * run.lanes + lane - run.place; /* what was in front of these symbols is huge */
        unsigned ahead = word_at(run, lanes, group, word + of_group);
        decltype(prepare(0u)) prepared = {};
        if (next < of_lane)
            prepared = prepare(next);
        ROLLED for (unsigned round = first_round; round * run.lanes < end; round++) {
            auto known = prepared;
            unsigned i = next;
            bool needs_word = false;
            next += run.lanes;
            if (next < of_lane)
                prepared = prepare(next);
            if (i < of_lane) {
                unsigned slot = x % TOTAL;
                Symbol symbol = read(i, known, slot);
                x = symbol.frequency * (x / TOTAL) + slot - symbol.start;                           /* (7-1) */
                needs_word = x < LOWEST_STATE;
                if (run.trace)
                    run.trace[run.decoded + i] = make_ushort4(symbol.start, symbol.frequency, run.pass, lane);
            }
            unsigned needing = __ballot_sync(EVERY_LANE, needs_word);
            unsigned own_word = __shfl_sync(EVERY_LANE, ahead, __popc(needing & ((1u << of_group) - 1)));
            x = needs_word ? x << 16 | own_word : x;
            word += __popc(needing);
            ahead = word_at(run, lanes, group, word + of_group);
        }
        __syncwarp();
        if (lane < run.lanes)
            lanes.states[lane] = x;
        if (of_group == 0)
            lanes.taken[group] = word;
    }
    run.place += count;
    run.decoded += count;
    __syncthreads();
}

/* At least 25 bits of the string of raw bits, which goes from the end of the payload toward its start. */
static __device__ __forceinline__ unsigned string_bits(const RawBits &raw, unsigned at)
{
    unsigned first = at / 8, bits = 0;
    for (unsigned k = 0; k < 4; k++)
        if (first + k < raw.size)
            bits |= (unsigned)raw.text[raw.size - 1 - first - k] << 8 * k;
    return bits >> at % 8;
}

/* A raw value. Late ones begin in the final states of the lanes, 16 bits each. */
static __device__ __noinline__ unsigned raw_value(RawBits raw, const unsigned *states, unsigned at, unsigned size)
{
    unsigned value = 0;
    ROLLED for (unsigned have = 0; have < size; at += 16 - at % 16) {
        if (at >= raw.carried) {
            value |= string_bits(raw, raw.early + at - raw.carried) << have;
            break;
        }
        value |= ((states[at / 16] & 0xFFFF) >> at % 16) << have;
        have += 16 - at % 16;
    }
    return value & ((1u << size) - 1);
}

/* Raw values of items in their order: of `size(i)` bits each, and `take(i, value)` gets those that have some. */
template <class Size, class Take>
__device__ void read_raw(Run &run, const Lanes &lanes, unsigned count, Size size, Take take)
{
    Share own = share_of(count);
    unsigned bits = 0;
    ROLLED for (unsigned i = own.first; i < own.end; i++)
        bits += size(i);
    uint2 sum = sum_before(bits);
    unsigned at = run.at + sum.x;
    ROLLED for (unsigned i = own.first; i < own.end; i++) {
        unsigned own_size = size(i);
        if (own_size > 0)
            take(i, raw_value(run.raw, lanes.states, at, own_size));
        at += own_size;
    }
    run.at += sum.y;
    __syncthreads();
}

/* How many bits they have. */
template <class Size> __device__ unsigned bits_of_share(unsigned count, Size size)
{
    Share own = share_of(count);
    unsigned bits = 0;
    ROLLED for (unsigned i = own.first; i < own.end; i++)
        bits += size(i);
    return bits;
}

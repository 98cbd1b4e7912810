/* What both profiles' entropy decoders have in common (spec.md 7 and 15.6). */

#pragma once

#include "blocks.cuh"

#define LOWEST_STATE 0x10000u

struct Symbol {
    unsigned value, start, frequency;       /* s, c(s), f(s) */
};

/* The symbol of a slot, by a table of C. */
template <class Number> __device__ __forceinline__ Symbol symbol_of_table(const Number *C, unsigned bins, unsigned slot)
{
    unsigned low = 0, high = bins, start = C[0], end = C[bins];     /* start = C[low] <= slot < C[high] = end */
    ROLLED while (high - low > 1) {
        unsigned middle = (low + high) / 2, value = C[middle];
        if (value <= slot) {
            low = middle;
            start = value;
        } else {
            high = middle;
            end = value;
        }
    }
    return {low, start, end - start};
}

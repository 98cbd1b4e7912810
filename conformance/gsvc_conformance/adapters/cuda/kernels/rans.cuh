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
    unsigned low = 0, high = bins;          /* C[low] <= slot < C[high] */
    ROLLED while (high - low > 1) {
        unsigned middle = (low + high) / 2;
        if (C[middle] <= slot)
            low = middle;
        else
            high = middle;
    }
    return {low, C[low], (unsigned)C[low + 1] - C[low]};
}

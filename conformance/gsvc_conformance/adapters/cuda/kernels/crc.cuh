/* CRC-32C (spec.md 6.2): a remainder of polynomials modulo x^32 + ..., whose bits are in reverse: the top bit is that of x^0. */

#pragma once

#include "common.cuh"

#define POLYNOMIAL 0x82F63B78u
#define X_TO_32 POLYNOMIAL
#define X_TO_8 0x00800000u

/* A register after one more bit of zeros, which is its product with x. */
static __device__ __forceinline__ unsigned shifted(unsigned a)
{
    return a & 1 ? a >> 1 ^ POLYNOMIAL : a >> 1;
}

static __device__ unsigned crc_product(unsigned a, unsigned b)
{
    unsigned sum = 0;
    for (; b != 0; b <<= 1, a = shifted(a))
        sum ^= b & 0x80000000u ? a : 0;
    return sum;
}

static __device__ unsigned crc_power(unsigned base, unsigned long long exponent)
{
    unsigned power = 0x80000000u;           /* 1 */
    for (; exponent != 0; exponent >>= 1, base = crc_product(base, base))
        power = exponent & 1 ? crc_product(power, base) : power;
    return power;
}

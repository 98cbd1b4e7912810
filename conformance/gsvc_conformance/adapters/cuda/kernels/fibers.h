/* CUDA C++ for a CPU: what these kernels use of it, for tests where there is no GPU.

   The threads of a block are fibers, one block after the other. A fiber runs until it ends or has to wait for others in a
   collective operation, and then the next one runs. With DESCENDING the last block and the last thread come first: a
   kernel that has forgotten to wait for somebody gives something else in one of both orders. (On a GPU,
   `compute-sanitizer --tool racecheck` looks for that.) The compiler has to be told that it may fuse nothing. */

#include <setjmp.h>
#include <sys/mman.h>
#include <ucontext.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <utility>
#include <vector>

#define __global__
#define __device__
#define __constant__ static
#define __shared__ static
#define __forceinline__ inline
#define __noinline__ __attribute__((noinline))
#define __launch_bounds__(...)
#define __align__(n) alignas(n)

using std::max;
using std::min;

struct uint3 { unsigned x, y, z; };
struct alignas(8) float2 { float x, y; };
struct float3 { float x, y, z; };
struct alignas(16) float4 { float x, y, z, w; };
struct alignas(8) int2 { int x, y; };
struct int3 { int x, y, z; };
struct alignas(16) int4 { int x, y, z, w; };
struct alignas(8) uint2 { unsigned x, y; };
struct alignas(16) uint4 { unsigned x, y, z, w; };
struct alignas(4) uchar4 { unsigned char x, y, z, w; };
struct alignas(8) ushort4 { unsigned short x, y, z, w; };
struct alignas(16) double2 { double x, y; };
static inline float2 make_float2(float x, float y) { return {x, y}; }
static inline float3 make_float3(float x, float y, float z) { return {x, y, z}; }
static inline float4 make_float4(float x, float y, float z, float w) { return {x, y, z, w}; }
static inline int2 make_int2(int x, int y) { return {x, y}; }
static inline int3 make_int3(int x, int y, int z) { return {x, y, z}; }
static inline int4 make_int4(int x, int y, int z, int w) { return {x, y, z, w}; }
static inline uint2 make_uint2(unsigned x, unsigned y) { return {x, y}; }
static inline uint4 make_uint4(unsigned x, unsigned y, unsigned z, unsigned w) { return {x, y, z, w}; }

static inline ushort4 make_ushort4(unsigned short x, unsigned short y, unsigned short z, unsigned short w) { return {x, y, z, w}; }

static uint3 threadIdx, blockIdx, blockDim, gridDim;
static const int warpSize = 32;

namespace fibers {

const size_t STACK = 256 << 10;

/* Lanes that wait for each other: the lowest of them has it. */
struct Meeting { unsigned arrived, times; };

struct Warp {
    unsigned alive;
    Meeting meetings[32];
    uint64_t words[32];                     /* what the lanes show each other */
};

struct Fiber {
    jmp_buf place;
    uint3 thread;
    bool begun, ended;
};

static std::mutex one_launch;
static jmp_buf outside;
static std::vector<Fiber> all;
static std::vector<Warp> warps;
static int count, current, living, idle;
static Meeting block;
static void (*body)(void *);
static void *arguments;

static void live();

/* Leaves whatever runs for a fiber: where it has stopped, or at its beginning. */
static void enter(int next)
{
    current = next;
    Fiber &fiber = all[next];
    threadIdx = fiber.thread;
    if (fiber.begun)
        _longjmp(fiber.place, 1);           /* it leaves the signals alone, unlike swapcontext, and is ten times as fast */
    fiber.begun = true;
    ucontext_t start;
    getcontext(&start);
    start.uc_stack.ss_sp = mmap(nullptr, STACK, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    start.uc_stack.ss_size = STACK;
    makecontext(&start, live, 0);
    setcontext(&start);
}

/* Goes on with another fiber; this one comes back when somebody enters it. */
static void resume(int next)
{
    if (_setjmp(all[current].place) == 0)
        enter(next);
}

#ifdef DESCENDING
static unsigned nth(unsigned n, unsigned of) { return of - 1 - n; }
static const int STEP = -1;
#else
static unsigned nth(unsigned n, unsigned) { return n; }
static const int STEP = 1;
#endif

static int after(int fiber)
{
    do
        fiber = (fiber + STEP + count) % count;
    while (all[fiber].ended);
    return fiber;
}

/* A fiber runs its thread of one block after the other. */
static void live()
{
    for (;;) {
        body(arguments);
        all[current].ended = true;
        warps[current / 32].alive &= ~(1u << current % 32);
        idle = 0;
        if (--living == 0) {
            if (_setjmp(all[current].place) == 0)
                _longjmp(outside, 1);
        } else
            resume(after(current));
    }
}

/* Waits until `complete` says that all have arrived; the others go on meanwhile. */
template <class Complete> static void wait(Meeting &meeting, Complete complete)
{
    unsigned before = meeting.times;
    while (meeting.times == before)
        if (complete()) {
            meeting.arrived = 0;
            meeting.times++;
            idle = 0;
        } else if (++idle > 4 * count)
            _longjmp(outside, 2);
        else
            resume(after(current));
}

static void meet(unsigned mask)
{
    Warp &warp = warps[current / 32];
    Meeting &meeting = warp.meetings[__builtin_ctz(mask)];
    meeting.arrived |= 1u << current % 32;
    idle = 0;
    wait(meeting, [&] { return (mask & warp.alive & ~meeting.arrived) == 0; });
}

static void meet_block()
{
    block.arrived++;
    idle = 0;
    wait(block, [] { return block.arrived >= (unsigned)living; });
}

/* What each lane of the mask shows: read(words) is the answer, and nobody shows anything new before all have read. */
template <class T, class Read> static auto exchange(unsigned mask, T shown, Read read)
{
    Warp &warp = warps[current / 32];
    static_assert(sizeof(T) <= 8, "a lane shows up to 64 bits");
    std::memcpy(&warp.words[current % 32], &shown, sizeof shown);
    meet(mask);
    auto answer = read(warp.words);
    meet(mask);
    return answer;
}

template <class T> static T shuffle(unsigned mask, T value, int from)
{
    return exchange(mask, value, [=](const uint64_t *words) {
        T seen;
        std::memcpy(&seen, &words[from], sizeof seen);
        return seen;
    });
}

template <class... A, size_t... I> static void call(void (*kernel)(A...), void **values, std::index_sequence<I...>)
{
    kernel(*(std::remove_reference_t<A> *)values[I]...);
}

/* All blocks of a kernel, whose arguments are where these addresses say; 1 if threads wait for others in vain. */
template <class... A> static int launch(void (*kernel)(A...), const unsigned *size, void **values)
{
    std::lock_guard<std::mutex> alone(one_launch);
    auto run = [=] { call(kernel, values, std::index_sequence_for<A...>()); };
    body = [](void *p) { (*(decltype(run) *)p)(); };
    arguments = &run;
    gridDim = {size[0], size[1], size[2]};
    blockDim = {size[3], size[4], size[5]};
    count = size[3] * size[4] * size[5];
    if ((int)all.size() < count) {
        all.resize(count);
        warps.resize((count + 31) / 32);
    }
    for (unsigned z = 0; z < gridDim.z; z++)
        for (unsigned y = 0; y < gridDim.y; y++)
            for (unsigned x = 0; x < gridDim.x; x++) {
                blockIdx = {nth(x, gridDim.x), nth(y, gridDim.y), nth(z, gridDim.z)};
                std::memset(warps.data(), 0, warps.size() * sizeof(Warp));
                for (int n = 0; n < count; n++) {
                    unsigned u = n;
                    all[n].thread = {u % blockDim.x, u / blockDim.x % blockDim.y, u / blockDim.x / blockDim.y};
                    all[n].ended = false;
                    warps[n / 32].alive |= 1u << n % 32;
                }
                block = {0, 0};
                living = count;
                idle = 0;
                int came = _setjmp(outside);
                if (came == 0)
                    enter(nth(0, count));
                if (came == 2) {
                    all.clear();            /* their stacks are in the middle of something */
                    return 1;
                }
            }
    return 0;
}

}  // namespace fibers

#define KERNEL_OF_FIBERS(name)                                                                                                 \
    extern "C" int fibers_##name(const unsigned *size, void **values) { return fibers::launch(name, size, values); }

static inline void __syncthreads() { fibers::meet_block(); }
static inline void __syncwarp(unsigned mask = ~0u) { fibers::meet(mask); }
static inline void __threadfence() {}

static inline unsigned __ballot_sync(unsigned mask, int predicate)
{
    unsigned alive = mask & fibers::warps[fibers::current / 32].alive;
    return fibers::exchange(mask, (uint64_t)(predicate != 0), [=](const uint64_t *words) {
        unsigned ballot = 0;
        for (int lane = 0; lane < 32; lane++)
            ballot |= (alive >> lane & (unsigned)words[lane] & 1) << lane;
        return ballot;
    });
}

static inline int __any_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) != 0; }
static inline int __all_sync(unsigned mask, int predicate) { return __ballot_sync(mask, !predicate) == 0; }

template <class T> static T __shfl_sync(unsigned mask, T value, int from) { return fibers::shuffle(mask, value, from & 31); }

template <class T> static T __shfl_xor_sync(unsigned mask, T value, int across)
{
    return fibers::shuffle(mask, value, (fibers::current % 32) ^ across);
}

template <class T> static T __shfl_up_sync(unsigned mask, T value, int by)
{
    int lane = fibers::current % 32;
    return fibers::shuffle(mask, value, lane < by ? lane : lane - by);
}

template <class T> static T __shfl_down_sync(unsigned mask, T value, int by)
{
    int lane = fibers::current % 32;
    return fibers::shuffle(mask, value, lane + by > 31 ? lane : lane + by);
}

/* No other fiber runs meanwhile. There is none for float: those of a GPU flush subnormal numbers. */
template <class T, class Change> static T atomically(T *place, Change change)
{
    T old = *place;
    *place = change(old);
    return old;
}
#define ATOMIC(name, type, change)                                                                                             \
    static inline type name(type *place, type value)                                                                           \
    {                                                                                                                          \
        return atomically(place, [=](type old) -> type { return change; });                                                    \
    }
#define ATOMICS(type)                                                                                                          \
    ATOMIC(atomicAdd, type, old + value) ATOMIC(atomicMin, type, min(old, value)) ATOMIC(atomicMax, type, max(old, value))     \
    ATOMIC(atomicAnd, type, old & value) ATOMIC(atomicOr, type, old | value) ATOMIC(atomicXor, type, old ^ value)              \
    ATOMIC(atomicExch, type, value)
ATOMICS(int)
ATOMICS(unsigned)
ATOMICS(unsigned long long)
ATOMIC(atomicAdd, double, old + value)

template <class To, class From> static To bits_as(From from)
{
    static_assert(sizeof(To) == sizeof(From), "the same bits");
    To to;
    std::memcpy(&to, &from, sizeof to);
    return to;
}
static inline float __int_as_float(int v) { return bits_as<float>(v); }
static inline float __uint_as_float(unsigned v) { return bits_as<float>(v); }
static inline int __float_as_int(float v) { return bits_as<int>(v); }
static inline unsigned __float_as_uint(float v) { return bits_as<unsigned>(v); }
static inline double __longlong_as_double(long long v) { return bits_as<double>(v); }
static inline long long __double_as_longlong(double v) { return bits_as<long long>(v); }

static inline int __popc(unsigned v) { return __builtin_popcount(v); }
static inline int __popcll(unsigned long long v) { return __builtin_popcountll(v); }
static inline int __clz(int v) { return v == 0 ? 32 : __builtin_clz(v); }
static inline int __clzll(long long v) { return v == 0 ? 64 : __builtin_clzll(v); }
static inline int __ffs(int v) { return __builtin_ffs(v); }
static inline unsigned __umulhi(unsigned a, unsigned b) { return (unsigned)((uint64_t)a * b >> 32); }
static inline unsigned __brev(unsigned v)
{
    unsigned reversed = 0;
    for (int bit = 0; bit < 32; bit++)
        reversed |= (v >> bit & 1) << (31 - bit);
    return reversed;
}
template <class T> static T __ldg(const T *place) { return *place; }

#define ROUNDED(name, type, operation) static inline type name(type a, type b) { return a operation b; }
ROUNDED(__fadd_rn, float, +) ROUNDED(__fsub_rn, float, -) ROUNDED(__fmul_rn, float, *) ROUNDED(__fdiv_rn, float, /)
ROUNDED(__dadd_rn, double, +) ROUNDED(__dsub_rn, double, -) ROUNDED(__dmul_rn, double, *) ROUNDED(__ddiv_rn, double, /)
static inline float __fsqrt_rn(float a) { return std::sqrt(a); }
static inline double __dsqrt_rn(double a) { return std::sqrt(a); }
static inline float __fmaf_rn(float a, float b, float c) { return std::fma(a, b, c); }
static inline double __fma_rn(double a, double b, double c) { return std::fma(a, b, c); }
static inline int __float2int_rn(float a) { return (int)std::nearbyint(a); }
static inline unsigned __float2uint_rn(float a) { return (unsigned)std::nearbyint(a); }
static inline long long __double2ll_rn(double a) { return (long long)std::nearbyint(a); }

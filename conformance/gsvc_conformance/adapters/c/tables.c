/* The tables. They are made once, with 64 bits; a decoder without these keeps them as data. */
#include "decoder.h"

u32 exp2_table[1024], distributions[2][257];
u16 half_tables[ALPHAS][TABLED + 1][TABLED + 2];
const u8 alphas[ALPHAS] = {1, 2, 3, 4, 6, 10, 20, 100};
static u32 crc_table[256];

#define DIFFERENCES {432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2, REST_12}
#define SHAPES {576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2, 1, REST_12}
#define COLORS_1 {736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2, 1, REST_12}
#define COLORS_2 {944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2, 1, REST_12}
#define REST_12 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1
const u16 first_counts[ROWS][SYMBOLS] = {           /* MODELS: vector, mode, position, shape, color */
    {736, 152, 76, 40, 52, 36, 44, 28, 36, 20, 20, 10, 8, 4, 3, 2, 2, 1, 1, 1, 1, 1, 1, 1},
    {1024, 116, 36, 16, 16, 10, 12, 8, 10, 6, 6, 4, 3, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1},
    {500, 286, 116, 56, 62, 40, 50, 36, 44, 22, 28, 14, 10, 4, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1},
    {320, 148, 80, 56, 82, 68, 108, 74, 112, 68, 72, 36, 32, 10, 6, 2, 1, 1, 1, 1, 1, 1, 1, 1},
    {386, 102, 48, 44, 60, 50, 104, 66, 98, 80, 96, 54, 46, 18, 10, 5, 4, 1, 1, 1, 1, 1, 1, 1},
    {1184, 20, 24, 10, 14, 6, 7, 9, 6},
    {1032, 52, 68, 32, 40, 11, 17, 22, 6},
    {752, 92, 116, 66, 96, 26, 52, 74, 6},
    {928, 68, 92, 46, 48, 14, 33, 45, 6},
    {736, 116, 146, 92, 70, 26, 46, 50, 6},
    {336, 97, 193, 176, 92, 48, 122, 216, 6},
    {944, 52, 79, 49, 44, 16, 33, 57, 6},
    {912, 53, 84, 54, 56, 18, 41, 58, 6},
    {784, 53, 87, 70, 66, 22, 54, 138, 6},
    {1056, 27, 62, 32, 24, 11, 20, 26, 22},
    DIFFERENCES, DIFFERENCES, DIFFERENCES, DIFFERENCES,
    DIFFERENCES, DIFFERENCES, DIFFERENCES, DIFFERENCES, SHAPES, SHAPES, SHAPES,
    {264, 244, 228, 148, 152, 76, 72, 36, 24, 10, 8, 4, REST_12},
    COLORS_1, COLORS_1, COLORS_1, COLORS_2, COLORS_2, COLORS_2,
};

static u64 product(u64 a, u64 b) {                  /* of numbers with 63 bits after the point */
    u64 low = (a >> 32) * (b & 0xFFFFFFFF) + ((a & 0xFFFFFFFF) * (b & 0xFFFFFFFF) >> 32);
    u64 middle = (a & 0xFFFFFFFF) * (b >> 32) + (low & 0xFFFFFFFF);
    return ((a >> 32) * (b >> 32) + (low >> 32) + (middle >> 32)) * 2;
}

static void make_exp2(void) {
    static const u64 roots[10] = {                  /* 2^(1/2), 2^(1/4) ... 2^(1/1024) */
        0xb504f333f9de6484, 0x9837f0518db8a96f, 0x8b95c1e3ea8bd6e6, 0x85aac367cc487b14, 0x82cd8698ac2ba1d7,
        0x8164d1f3bc030773, 0x80b1ed4fd999ab6c, 0x8058d7d2d5e5f6b0, 0x802c6436d0e04f50, 0x8016302f17467628};
    for (u32 i = 0; i < 1024; i++) {
        u64 power = 1ull << 63;
        for (u32 k = 0; k < 10; k++) if (i >> (9 - k) & 1) power = product(power, roots[k]);
        exp2_table[i] = (u32)((power + (1ull << 47)) >> 48);
    }
}

static void make_distributions(void) {              /* (15-3) */
    for (i32 i = 1; i <= 128; i++) {
        u32 tail = (u32)exp2_of(96 * (128 - i), 15);
        distributions[0][i] = (1u << 31) / ((1u << 15) + tail);
        distributions[1][i] = (1u << 30) / tail;
    }
    for (u32 family = 0; family < 2; family++) {
        for (u32 i = 1; i < 128; i++) distributions[family][256 - i] = (1u << 16) - distributions[family][i];
        distributions[family][256] = 1u << 16;
    }
}

static void make_half_tables(void) {                /* (15-8) */
    for (u32 a = 0; a < ALPHAS; a++) {
        for (u32 n = 1; n <= TABLED; n++) {
            u64 w[TABLED + 1] = {1u << 16}, sum = 0, before = 0;
            for (u32 i = 0; i < n / 2; i++) {
                w[i + 1] = w[i] * (n - i) * (i + alphas[a]) / ((i + 1) * (u64)(n - i - 1 + alphas[a]));
            }
            for (u32 i = 0; i <= n; i++) sum += w[i] = w[i < n - i ? i : n - i];
            for (u32 i = 1; i <= n; i++) {
                before += w[i - 1];
                half_tables[a][n][i] = (u16)(i + (TOTAL - n - 1) * before / sum);
            }
            half_tables[a][n][n + 1] = TOTAL;
        }
    }
}

void make_tables(void) {
    make_exp2();
    make_distributions();
    make_half_tables();
    for (u32 byte = 0; byte < 256; byte++) {
        u32 value = byte;
        for (u32 k = 0; k < 8; k++) value = value >> 1 ^ (value & 1 ? 0x82F63B78 : 0);
        crc_table[byte] = value;
    }
}

u32 crc32c(u32 before, const void *data, size_t size) {
    u32 value = ~before;
    for (const u8 *byte = data, *end = byte + size; byte < end; byte++) {
        value = value >> 8 ^ crc_table[(value ^ *byte) & 255];
    }
    return ~value;
}

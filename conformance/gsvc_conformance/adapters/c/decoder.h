/* A decoder of profile `main` of GSVC in C11, written from spec.md: what its files share.

   tables.c    the tables of sections 15.3, 15.8 and 15.11, and CRC-32C
   splats.c    what is done to each splat by itself: states, parameters, work, motion (15.4, 15.9 to 15.11)
   run.c       the entropy coder: lanes, groups, raw bits, distributions (15.6 to 15.8, 15.11)
   body.c      frame_body(), pass by pass (15.5 to 15.12)
   stream.c    chunks, frames, layers, limits and faults (5, 6, 12, 15.13)
   serve.c     the protocol of the kit

   All of it is integers of 32 bits, but for offsets, sums of work and the making of tables, which have 64; binary32 is
   only what `parameters_of` gives, by operations that are exact. It has the structure of a decoder for a GPU: each loop
   over the symbols of a pass, over splats, cells or parts has rounds that do not depend on one another, so that it can
   be a kernel; and what one loop leaves to the next is in arrays. Comments say where a kernel needs a prefix sum. */
#ifndef DECODER_H
#define DECODER_H

#include <setjmp.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef uint8_t u8;
typedef uint16_t u16;
typedef uint32_t u32;
typedef uint64_t u64;
typedef int32_t i32;

static inline i32 min_of(i32 a, i32 b) { return a < b ? a : b; }
static inline i32 max_of(i32 a, i32 b) { return a > b ? a : b; }
static inline i32 clipped(i32 value, i32 low, i32 high) { return max_of(low, min_of(value, high)); }
static inline u32 bit_length(u32 value) { return value ? 32 - (u32)__builtin_clz(value) : 0; }
static inline u32 halved(u32 side, u32 halvings) { return (side + (1u << halvings) - 1) >> halvings; }
static inline u32 u16_at(const u8 *bytes) { return bytes[0] | (u32)bytes[1] << 8; }
static inline u32 u32_at(const u8 *bytes) { return u16_at(bytes) | u16_at(bytes + 2) << 16; }
/* ⌊value / 2^bits⌋, also of negative values: C leaves >> of those to the compiler, and all that are in use do this. */
static inline i32 floor_shift(i32 value, u32 bits) { return value >> bits; }
static inline i32 floor_divided(i32 value, i32 by) { return value >= 0 ? value / by : -((by - 1 - value) / by); }

/* Memory. */
struct arena { struct piece *last; };               /* pieces that are freed together */
void *take(struct arena *arena, u64 count, size_t size); /* zeros; it ends the program where there is no memory */
void free_all(struct arena *arena);

/* Tables. */
enum { TOTAL = 1 << 14, ALPHAS = 8, TABLED = 15, ROWS = 33, SYMBOLS = 24, MODES = 9, MAGNITUDES = 40, CLASSES = 11 };
enum { VECTOR = 0, MODE = 5, POSITION = 15, SHAPE = 19, COLOR = 26 }; /* first rows of the models (15.11) */
extern u32 exp2_table[1024], distributions[2][257];
extern u16 half_tables[ALPHAS][TABLED + 1][TABLED + 2]; /* C by the index of α and n (15-8) */
extern const u8 alphas[ALPHAS];
extern const u16 first_counts[ROWS][SYMBOLS];
void make_tables(void);
u32 crc32c(u32 before, const void *data, size_t size); /* of all bytes so far; `before` is 0 at the beginning */

/* Splats. */
struct splat { i32 X, Y, A, B, S, n[3]; };          /* a state (15.4) */
struct field { u32 columns, rows, cell; i32 (*vectors)[2]; u8 *unrest; }; /* `cell` is 0 where there is no field */
struct codes { i32 column, row, color[3], shape[3], place[2]; };
i32 exp2_of(i32 v, i32 k);
i32 step_of(u32 quantizer);
i32 class_of(const i32 n[3], i32 D);
i32 size_step(i32 j);
i32 shear_step(i32 j);
u32 place_bits(const struct codes *codes, i32 j, i32 axis);
void color_of(const i32 k[3], i32 D, i32 n[3]);
struct splat intra_state(const struct codes *codes, i32 D);
struct splat inter_state(const struct splat *before, const i32 motion[2], const i32 q[8], i32 D);
void parameters_of(const struct splat *splat, float parameters[8]);
u32 checksum_of(const struct splat *splats, u32 count);
u64 work_of(const struct splat *splats, u32 count, u32 width, u32 height, u32 halvings);
u32 cells_of(u32 side, u32 motion_cell);
void motion_of(const struct splat *splat, const struct field *field, i32 motion[2]);
void find_unrest(struct field *field);
void add_up_vectors(struct field *field);
void cells_of_halves(struct arena *memory, u32 width, u32 height, u32 count, const i32 *first, i32 (*cells)[2]);
u32 mode_context(const struct splat *splat, u32 past, const i32 motion[2], const struct field *field, u32 width,
                 u32 height);

/* Distributions: C[0] = 0 to C[bins] = 2^14, from a table, or of a density with (doubled) edges at equal distances. */
struct distribution {
    const u16 *table;                               /* NULL: a density */
    u32 bins;
    i32 first_edge, edge_step, centre;
    u32 family, scale_code, unit_bits;
};
struct window { struct distribution bins; i32 first; u32 low_bits; };
u32 density_at(const struct distribution *density, u32 bin, i32 edge);
u32 cumulative_at(const struct distribution *distribution, u32 bin);
struct distribution magnitude_density(u32 family, u32 scale_code, i32 centre);
struct window window_of(i32 centre, i32 step, u32 family, u32 scale_code);
struct distribution half_of(u32 count, u32 first_half, u32 second_half, u32 alpha, u32 *low_bits);
void model_frequencies(const u32 *counts, u32 symbols, u16 *cumulative);
void adapt_model(u32 *counts, const u32 *seen, u32 symbols);
u32 magnitude_low_bits(u32 class);
i32 magnitude_of(u32 class, u32 low);

/* Faults: the first one ends the decoding of a stream. */
struct bits {
    struct decoder *decoder;
    const u8 *data;
    u64 size, at;                                   /* bytes of the data; the next bit */
    u64 first_bit, element;                         /* offsets in the stream: of the data; of the element read last */
    const char *end_rule;                           /* what is broken by an element that does not fit */
};
_Noreturn void fault(struct decoder *decoder, const char *rule, u64 bit);
void need(struct bits *bits, u64 count);
u32 read_u(struct bits *bits, u32 count);
u32 read_le(struct bits *bits, u32 bytes);
u32 read_uv(struct bits *bits);
u64 position(const struct bits *bits);

/* The run of a frame. */
enum { LANES = 1 << 12, GROUP = 32, LOWEST_STATE = 1 << 16 };
struct run {
    struct decoder *decoder;
    const u8 *payload;
    u64 payload_bit;
    u32 state_at, words_at, end;                    /* bytes of the payload: the states, R0, END */
    u32 lanes, groups, states[LANES], next[LANES / GROUP], limit[LANES / GROUP]; /* words of a group: bytes */
    u32 pass, symbols;                              /* the number of the pass, and how many symbols it had so far */
    u32 early, late, late_at, in_states;            /* bits */
    bool counting;                                  /* late bits are not read, but counted */
};
void begin_run(struct run *run, struct bits *bits, u32 lane_exponent);
void begin_pass(struct run *run, u32 pass);
u32 next_symbol(struct run *run, const struct distribution *distribution);
u32 early_bits(struct run *run, u32 size);
void begin_late(struct run *run, bool counting);
u32 late_bits(struct run *run, u32 size);
void finish_run(struct run *run);

/* What a layer carries from frame to frame; layer 0 is the base. */
struct plane { u32 family, scale_code; i32 centre, slope; };
struct carried {
    bool there, known;                              /* in the frame; in the frame before, so that it can be predicted */
    u32 count;
    struct splat *splats;
    u8 *past;
    u32 counts[ROWS][SYMBOLS];
    bool has_densities;
    struct plane planes[6];
    u8 alpha[32];                                   /* the index of α of each halving */
    u32 quantizer;
    u64 work, point_work;                           /* of its splats: at full size; at the operating point */
};

/* What frame_body() says: for `read_main_stream`. */
struct body {
    u32 lane_exponent, motion_cell, densities_present, count, before;
    struct field field;                             /* its own, or that of the base */
    u8 *modes;
    i32 (*differences)[8];
};

struct limits { u64 pixels, splats, work, payload; };
struct header {
    u32 profile, level, flags, width, height, frame_rate_numerator, frame_rate_denominator, frame_count;
    u32 max_lane_exponent, layer_count, quality_level[4], quality_halvings[4];
    u32 elements[28], element_count;                /* all of them, in their order */
};

struct decoder {
    jmp_buf on_fault;
    const char *rule;                               /* the fault, NULL if there is none */
    u64 bit;
    struct header header;
    u32 quality;                                    /* the layer up to which is decoded */
    struct limits limits, point_limits;             /* of `level`; of the operating point */
    bool has_point;                                 /* that says less than `level` */
    u32 halvings;
    struct carried layers[4];
    u32 frame_number, next_number;                  /* of the frame that is open; of the next one */
    u32 mask, last_layer, layer_at_work;            /* its layers; the last one after it; 0 between chunks `n` */
    char frame_type;
    bool open;                                      /* the base is complete, and chunks `n` may follow */
    struct field base_field;
    struct arena stream_memory, base_memory, layer_memory;
    u32 index_length;
    u64 waiting;                                    /* bytes of the chunks that do not count in a second so far */
    struct second { u64 pixels, splats, work, bytes; } second, point_second; /* sums, by `level` and by the point */
    u64 last_i_frame;
    void *reader;                                   /* whom these tell: */
    void (*on_symbol)(void *reader, u32 start, u32 frequency, u32 pass, u32 lane); /* NULL: nobody asks */
    void (*on_body)(void *reader, const struct decoder *decoder, const struct body *body); /* of the base */
    void (*on_frame)(void *reader, const struct decoder *decoder); /* a frame with its layers */
};
void read_body(struct decoder *decoder, struct bits *bits, char type, u32 layer, u64 others);
void check_splats(struct decoder *decoder, u64 count, u64 bit);
void decode(struct decoder *decoder, const u8 *stream, u64 size); /* to the end, or to the fault */
const char *kind_of(const char *rule);

#endif

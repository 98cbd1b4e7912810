/* Profile main: the body of a frame (spec.md 15.5 to 15.12), from its bytes to states, by one block.

   One launch reads it all: the head and the densities (thread 0), then pass by pass the symbols (a warp for 32 lanes) and
   the early raw values (all threads), then the late ones, and at last the states of the splats. Nothing comes back to the
   host but a Status, which may be read long afterwards: where it has a fault, the layer after the frame is empty, and
   whatever comes next does no harm. */

#include "crc.cuh"
#include "main_parts.cuh"
#include "main_run.cuh"
#include "main_splats.cuh"

struct Plane {
    unsigned family, scale_code;
    int centre, slope;
};

/* What a layer carries from frame to frame, besides states and what the frame did with each splat. */
struct Layer {
    unsigned count, quantizer, has_densities;
    Plane planes[6];
    unsigned halving_codes[32];
    unsigned counts[ROWS][SYMBOLS];
};

/* What the host tells of a frame. */
struct Told {
    unsigned body_at, end;                  /* bytes of the text: where the body begins, and where its payload ends */
    unsigned checked;                       /* bytes in front of chunk_crc; 0: it is not compared */
    int intra;                              /* 1: the frame is an I */
    int width, height;
    unsigned max_lane_exponent;
    int splat_limits[2];                    /* R-5-2 and R-5-9; below 0 if other layers have more */
    unsigned halvings;                      /* of the operating point */
    unsigned long long work_limits[2];      /* R-5-4 and R-5-9 */
};

/* What the host may ask for afterwards. */
struct Status {
    unsigned rule, bit;                     /* of the fault, counted from the beginning of the text */
    unsigned count, before, new_count;
    unsigned quantizer, lane_exponent, motion_cell, densities_present, symbols;
    unsigned long long works[2];            /* of the frame, and at the size of the operating point */
};

/* A motion field in memory: these numbers, and behind them the vectors. */
struct FieldHead {
    int side, columns, rows, unused;
};

/* Arrays of a frame, in the workspace. */
struct Frame {
    int width, height, D;
    unsigned before, count;                 /* splats of the frame before, and new ones */
    Field field;                            /* what moves the splats */
    int2 *vectors;                          /* where its own one is made */
    unsigned char *vector_classes;
    int2 *motion;
    unsigned char *contexts, *modes;
    unsigned *changed[3], changed_count[3]; /* the splats that have each group of differences, by their numbers */
    unsigned char *classes[8];              /* of the magnitudes of differences, by their places in these lists */
    int *differences;                       /* q of all splats, component by component */
    unsigned halvings, parts, asked_count;
    Part *part[2];                          /* before and after a halving in turn */
    unsigned *asked, *first;                /* the parts that are asked; how many splats of each are in its first half */
    unsigned *cells;                        /* of each splat, as a Part has them */
    unsigned short *magnitudes;             /* C of luma, and of each chroma by the class of luma */
    unsigned short *windows;                /* C by component and class of the splat */
    unsigned char *color_classes, *splat_classes;
    int *colors, *shapes, *places;
};

/* What the threads share. */
struct Shared {
    Lanes lanes;
    unsigned short cumulative[ROWS][SYMBOLS + 1];
    unsigned seen[ROWS][SYMBOLS];
    Window windows[3][CLASSES];
    Status status;
    Frame frame;
    Plane planes[6];
    unsigned halving_codes[32];
    unsigned text_at, groups, first_word;   /* bytes: the lane states, the first word */
    unsigned wrong_lane;
    unsigned crc_table[256], crc_powers[32], crc;
};

__constant__ unsigned FIRST_OF_GROUP[4] = {0, 2, 5, 8};
__constant__ unsigned ROW_OF_GROUP[3] = {POSITION, SHAPE, COLOR};
__constant__ int SIDES[4] = {0, 64, 32, 16};

/* ---- The head, by one thread */

static __device__ void refuse(Status &status, unsigned rule, unsigned bit)
{
    if (status.rule == SOUND) {
        status.rule = rule;
        status.bit = bit;
    }
}

/* Elements of the text; after a fault all of them are 0. */
struct Bits {
    const unsigned char *text;
    unsigned at, end, element;              /* bits: the next one, the end, and where the element read last began */
    Status *status;

    __device__ __noinline__ bool fits(unsigned size, unsigned start)
    {
        element = start;
        if (size > end - at)
            refuse(*status, R_6_2_3, start);
        return status->rule == SOUND;
    }
    __device__ __noinline__ unsigned u(unsigned size)     /* up to 17 bits, of three bytes at most */
    {
        unsigned first = at / 8, window = 0;
        if (!fits(size, at))
            return 0;
        for (unsigned k = 0; k < 3; k++)
            window = window << 8 | (first + k < end / 8 ? text[first + k] : 0);
        at += size;
        return window >> (24 - at + 8 * first) & ((1u << size) - 1);
    }
    __device__ __noinline__ unsigned uv()
    {
        unsigned start = at, value = 0, byte = 0x80, group = 0;
        ROLLED for (; byte >= 0x80 && group < 5; group++) {
            if (!fits(8, start))
                return 0;
            byte = text[at / 8];
            at += 8;
            value |= (byte & 0x7F) << 7 * group;
        }
        if (byte >= 0x80 || (group == 5 && byte > 15) || (byte == 0 && group > 1))
            refuse(*status, R_3_1_1, start);
        return value;
    }
    __device__ void require(bool holds, unsigned rule)
    {
        if (!holds)
            refuse(*status, rule, element);
    }
};

static __device__ void read_head(Bits &p, const Told &told, const Layer &layer, Status &status)
{
    status.lane_exponent = p.u(4);
    p.require(status.lane_exponent <= 12, R_3_2_1);
    p.require(status.lane_exponent <= told.max_lane_exponent, R_15_5_1);
    status.motion_cell = p.u(2);
    p.require(status.motion_cell == 0 || layer.count > 0, R_15_5_2);
    bool quantizer_present = p.u(1);
    p.require(quantizer_present || !told.intra, R_15_5_5);
    bool new_present = p.u(1);
    status.quantizer = layer.quantizer;
    if (quantizer_present) {
        status.quantizer = p.u(8);
        p.require(status.quantizer <= 79, R_3_2_1);
    }
    if (new_present) {
        unsigned splat_number = p.uv();
        status.new_count = splat_number / 2 + 1;
        status.densities_present = splat_number % 2;
    }
    long long splats = (long long)status.new_count + layer.count;
    p.require(splats <= told.splat_limits[0], R_5_2);
    p.require(splats <= told.splat_limits[1], R_5_9);
    bool none = status.new_count > 0 && !status.densities_present;
    p.require(!none || !told.intra, R_15_5_3);
    p.require(!none || layer.has_densities, R_15_5_4);
}

static __device__ void read_densities(Bits &p, unsigned halvings, Shared &shared)
{
    ROLLED for (int k = 0; k < 6; k++) {
        Plane &plane = shared.planes[k];
        plane.family = p.u(1);
        plane.scale_code = p.u(5);
        plane.centre = (int)p.u(10) - 512;
        plane.slope = k == 0 || k == 5 ? 0 : (int)p.u(8) - 128;
    }
    ROLLED for (unsigned k = 0; k < halvings; k++)
        shared.halving_codes[k] = p.u(3);
    if (p.at % 8 > 0)
        p.require(p.u(8 - p.at % 8) == 0, R_3_1_4);
}

/* The words of each group but the last (R-15.6-5). */
static __device__ void read_word_counts(Bits &p, unsigned groups, Lanes &lanes)
{
    unsigned long long sum = 0;
    ROLLED for (unsigned group = 0; group + 1 < groups && p.status->rule == SOUND; group++) {
        lanes.ends[group] = lanes.taken[group] = (unsigned)sum;
        sum += p.uv();
        p.require(sum <= (p.end - p.at) / 16, R_15_6_5);
    }
    lanes.ends[groups - 1] = lanes.taken[groups - 1] = (unsigned)sum;
    lanes.ends[groups] = (p.end - p.at) / 16;
}

/* ---- The predicted part */

static __device__ __forceinline__ Symbol read_modeled(Shared &shared, unsigned row, unsigned slot)
{
    Symbol symbol = symbol_of_table(shared.cumulative[row], symbols_of(row), slot);
    atomicAdd(&shared.seen[row][symbol.value], 1u);
    return symbol;
}

static __device__ __forceinline__ unsigned vector_context(unsigned x_class)
{
    return 1 + (x_class > 0) + (x_class > 2) + (x_class > 7);
}

static __device__ void read_vectors(Frame &f, Run &run, Shared &shared, int axis)
{
    unsigned char *classes = f.vector_classes;
    decode_symbols(
        run, shared.lanes, f.field.columns * f.field.rows,
        [&](unsigned i) { return VECTOR + (axis ? vector_context(classes[i]) : 0); },
        [&](unsigned i, unsigned row, unsigned slot) {
            Symbol symbol = read_modeled(shared, row, slot);
            classes[i] = symbol.value;
            return symbol;
        });
}

static __device__ void read_vector_bits(Frame &f, Run &run, Shared &shared, int axis)
{
    unsigned cells = f.field.columns * f.field.rows;
    unsigned char *classes = f.vector_classes;
    int *vectors = (int *)f.vectors + axis;
    Share own = share_of(cells);
    ROLLED for (unsigned i = own.first; i < own.end; i++)
        vectors[2 * i] = magnitude_of(classes[i], 0);
    read_raw(run, shared.lanes, cells, [&](unsigned i) { return bits_of_class(classes[i]); },
             [&](unsigned i, unsigned low) { vectors[2 * i] += low; });
    read_raw(run, shared.lanes, cells, [&](unsigned i) { return min((unsigned)classes[i], 1u); },
             [&](unsigned i, unsigned negative) { vectors[2 * i] = negative ? -vectors[2 * i] : vectors[2 * i]; });
}

static __device__ void read_modes(Frame &f, Run &run, Shared &shared, const State *states, const unsigned char *past)
{
    in_turn(f.before, [&](unsigned n) {
        f.motion[n] = motion_of_splat(states[n], f.field);
        f.contexts[n] = mode_context(states[n], past[n], f.motion[n], f.field, f.width, f.height);
    });
    __syncthreads();
    const unsigned char *contexts = f.contexts;
    unsigned char *modes = f.modes;         /* what a loop needs of shared memory it has in registers */
    decode_symbols(
        run, shared.lanes, f.before, [&](unsigned n) { return MODE + contexts[n]; },
        [&](unsigned n, unsigned row, unsigned slot) {
            Symbol symbol = read_modeled(shared, row, slot);
            modes[n] = symbol.value;
            return symbol;
        });
    ROLLED for (unsigned group = 0; group < 3; group++) {
        unsigned count = choose(f.before, f.changed[group], [&](unsigned n) {
            return modes[n] != REMOVED && (modes[n] >> group & 1);
        });
        if (threadIdx.x == 0)
            f.changed_count[group] = count;
    }
    __syncthreads();
}

/* The magnitudes of the components before component i of a group, at least as far as 2. */
static __device__ __forceinline__ unsigned sum_of_classes(const Frame &f, unsigned group, unsigned components, unsigned at)
{
    unsigned sum = 0;
    ROLLED for (unsigned k = 0; k < components; k++)
        sum += f.classes[FIRST_OF_GROUP[group] + k][at];
    return sum;
}

static __device__ void read_components(Frame &f, Run &run, Shared &shared, unsigned i)
{
    ROLLED for (unsigned group = 0; group < 3; group++) {
        unsigned component = FIRST_OF_GROUP[group] + i;
        if (component >= FIRST_OF_GROUP[group + 1])
            continue;
        unsigned char *classes = f.classes[component];
        decode_symbols(
            run, shared.lanes, f.changed_count[group],
            [&](unsigned at) {
                unsigned context = i > 0 ? 3 * (i - 1) + 1 + min(sum_of_classes(f, group, i, at), 2u) : 0;
                return ROW_OF_GROUP[group] + context;
            },
            [&](unsigned at, unsigned row, unsigned slot) {
                Symbol symbol = read_modeled(shared, row, slot);
                classes[at] = symbol.value;
                return symbol;
            });
    }
}

/* A component of a group: its late values, of which the second ones are signs. */
struct Component {
    const Frame &f;
    unsigned group, component;

    __device__ unsigned class_at(unsigned at) const { return f.classes[component][at]; }
    __device__ unsigned one_more(unsigned at) const       /* whether 1 was taken off its magnitude */
    {
        bool last = component + 1 == FIRST_OF_GROUP[group + 1];
        return last && sum_of_classes(f, group, component - FIRST_OF_GROUP[group], at) == 0;
    }
    __device__ unsigned low_size(unsigned at) const { return bits_of_class(class_at(at)); }
    __device__ unsigned sign_size(unsigned at) const { return class_at(at) + one_more(at) > 0; }
    __device__ int &difference(unsigned at) const { return f.differences[component * f.before + f.changed[group][at]]; }
};

static __device__ unsigned late_bits_of_differences(const Frame &f)
{
    unsigned bits = 0;
    ROLLED for (unsigned group = 0; group < 3; group++)
        ROLLED for (unsigned c = FIRST_OF_GROUP[group]; c < FIRST_OF_GROUP[group + 1]; c++) {
            Component own = {f, group, c};
            bits += bits_of_share(f.changed_count[group], [&](unsigned at) { return own.low_size(at) + own.sign_size(at); });
        }
    return bits;
}

static __device__ void read_late_differences(Frame &f, Run &run, Shared &shared)
{
    in_turn(8 * f.before, [&](unsigned n) { f.differences[n] = 0; });
    __syncthreads();
    ROLLED for (unsigned group = 0; group < 3; group++)
        ROLLED for (unsigned c = FIRST_OF_GROUP[group]; c < FIRST_OF_GROUP[group + 1]; c++) {
            Component own = {f, group, c};
            unsigned count = f.changed_count[group];
            Share share = share_of(count);
            ROLLED for (unsigned at = share.first; at < share.end; at++)
                own.difference(at) = magnitude_of(own.class_at(at), 0) + own.one_more(at);
            read_raw(run, shared.lanes, count, [&](unsigned at) { return own.low_size(at); },
                     [&](unsigned at, unsigned low) { own.difference(at) += low; });
            read_raw(run, shared.lanes, count, [&](unsigned at) { return own.sign_size(at); },
                     [&](unsigned at, unsigned negative) { own.difference(at) *= negative ? -1 : 1; });
        }
}

/* ---- New splats */

/* A part that is asked how many of its splats are in its first half. */
struct Asked {
    unsigned number;
    Part part;
};

static __device__ void read_halves(Frame &f, Run &run, Shared &shared, const Tables &tables, unsigned halving)
{
    int axis = halving % 2, inside = cells_inside(f.width, f.height, axis);
    int size = half_size(f.halvings, halving);
    unsigned halving_code = shared.halving_codes[halving];
    const Part *part = f.part[halving % 2];
    unsigned *list = f.asked, *first = f.first;
    unsigned asked = choose(f.parts, list, [&](unsigned n) { return second_half(part[n], axis, size, inside) > 0; });
    if (threadIdx.x == 0)
        f.asked_count = asked;
    __syncthreads();
    decode_symbols(
        run, shared.lanes, asked, [&](unsigned i) { return Asked{list[i], part[list[i]]}; },
        [&](unsigned i, const Asked &own, unsigned slot) {
            int second = second_half(own.part, axis, size, inside);
            Distribution d = half_density(tables, own.part.splats, size, second, halving_code);
            Symbol symbol = symbol_of_density(tables, d, slot);
            first[own.number] = symbol.value << low_bits_of_half(own.part.splats);
            return symbol;
        });
}

static __device__ void read_half_bits(Frame &f, Run &run, Shared &shared, unsigned halving)
{
    int axis = halving % 2, inside = cells_inside(f.width, f.height, axis);
    const Part *part = f.part[halving % 2];
    unsigned *list = f.asked, *first = f.first;
    if (low_bits_of_half(f.count) > 0)      /* else no part has any */
        read_raw(run, shared.lanes, f.asked_count, [&](unsigned i) { return low_bits_of_half(part[list[i]].splats); },
                 [&](unsigned i, unsigned low) { first[list[i]] += low; });
    unsigned parts = split_parts(part, f.parts, axis, half_size(f.halvings, halving), inside, f.part[1 - halving % 2],
                                 [&](unsigned n) { return first[n]; });
    if (threadIdx.x == 0)
        f.parts = parts;
    __syncthreads();
}

/* C of all distributions of new splats. */
static __device__ void make_frequencies(Frame &f, Shared &shared, const Tables &tables)
{
    const Plane *planes = shared.planes;
    in_turn(3 * CLASSES, [&](unsigned at) {
        unsigned k = at / CLASSES, j = at % CLASSES;
        const Plane &plane = planes[3 + k];
        int step = k == 2 ? shear_step(j) : size_step(j), centre = 64 * plane.centre + 16 * plane.slope * (int)j;
        shared.windows[k][j] = window_density(tables, centre, step, plane.family, plane.scale_code);
    });
    in_turn((1 + 2 * MAGNITUDES) * (MAGNITUDES + 1), [&](unsigned at) {
        unsigned table = at / (MAGNITUDES + 1), i = at % (MAGNITUDES + 1);
        const Plane &plane = planes[table == 0 ? 0 : table <= MAGNITUDES ? 1 : 2];
        int q = table == 0 ? 0 : (table - 1) % MAGNITUDES;
        Distribution d = magnitude_density(plane.family, plane.scale_code, plane.centre + (plane.slope * q >> 2));
        f.magnitudes[at] = cumulative_at(tables, d, i);
    });
    __syncthreads();
    in_turn(3 * CLASSES * WINDOW_MOST, [&](unsigned at) {
        unsigned window = at / WINDOW_MOST, i = at % WINDOW_MOST;
        const Distribution &d = (&shared.windows[0][0])[window].bins;
        if (i <= d.bins)
            f.windows[at] = cumulative_at(tables, d, i);
    });
    __syncthreads();
}

static __device__ void read_luma(Frame &f, Run &run, Shared &shared)
{
    const unsigned short *C = f.magnitudes;
    unsigned char *classes = f.color_classes;
    decode_symbols(
        run, shared.lanes, f.count, [&](unsigned) { return 0u; },
        [&](unsigned i, unsigned, unsigned slot) {
            Symbol symbol = symbol_of_table(C, MAGNITUDES, slot);
            classes[i] = symbol.value;
            return symbol;
        });
}

/* All k1, then all k2. */
static __device__ void read_chroma(Frame &f, Run &run, Shared &shared)
{
    unsigned count = f.count;
    const unsigned short *C = f.magnitudes;
    unsigned char *classes = f.color_classes;
    decode_symbols(
        run, shared.lanes, 2 * count,
        [&](unsigned i) { return i < count ? 1u + classes[i] : 1u + MAGNITUDES + classes[i - count]; },
        [&](unsigned i, unsigned table, unsigned slot) {
            Symbol symbol = symbol_of_table(C + table * (MAGNITUDES + 1), MAGNITUDES, slot);
            classes[count + i] = symbol.value;
            return symbol;
        });
}

/* The magnitudes of colour codes `first` to `end` of the 3 for each splat, component by component. */
static __device__ void read_color_bits(Frame &f, Run &run, Shared &shared, unsigned first, unsigned end)
{
    const unsigned char *classes = f.color_classes + first;
    int *colors = f.colors + first;
    Share own = share_of(end - first);
    ROLLED for (unsigned i = own.first; i < own.end; i++)
        colors[i] = magnitude_of(classes[i], 0);
    read_raw(run, shared.lanes, end - first, [&](unsigned i) { return bits_of_class(classes[i]); },
             [&](unsigned i, unsigned low) { colors[i] += low; });
}

static __device__ __forceinline__ const Window &window_of(const Frame &f, const Shared &shared, unsigned component, unsigned n)
{
    return shared.windows[component][f.splat_classes[n]];
}

/* All sizes, all aspects, all shears. */
static __device__ void read_shapes(Frame &f, Run &run, Shared &shared)
{
    in_turn(f.count, [&](unsigned n) {
        int color[3];
        for (int c = 0; c < 3; c++)
            color[c] = coded_color(f.colors[c * f.count + n], f.D);
        f.splat_classes[n] = splat_class(color, f.D);
    });
    __syncthreads();
    unsigned count = f.count;
    const unsigned short *windows = f.windows;
    const unsigned char *classes = f.splat_classes;
    int *shapes = f.shapes;
    decode_symbols(
        run, shared.lanes, 3 * count,
        [&](unsigned i) {
            unsigned component = (i >= count) + (i >= 2 * count);
            return component * CLASSES + classes[i - component * count];
        },
        [&](unsigned i, unsigned number, unsigned slot) {
            const Window &window = (&shared.windows[0][0])[number];
            Symbol symbol = symbol_of_table(windows + number * WINDOW_MOST, window.bins.bins, slot);
            shapes[i] = (window.first + (int)symbol.value) * (1 << window.low_bits);
            return symbol;
        });
}

static __device__ __forceinline__ unsigned place_bits(const Frame &f, unsigned i)
{
    unsigned axis = i >= f.count, n = axis ? i - f.count : i;
    return 2 - place_step(f.shapes[n], f.shapes[f.count + n], f.splat_classes[n], axis);
}

static __device__ unsigned late_bits_of_codes(const Frame &f, const Shared &shared)
{
    return bits_of_share(3 * f.count, [&](unsigned i) { return f.color_classes[i] > 0 ? 1u : 0u; })
           + bits_of_share(f.count, [&](unsigned n) { return window_of(f, shared, 2, n).low_bits; })
           + bits_of_share(2 * f.count, [&](unsigned i) { return place_bits(f, i); });
}

static __device__ void read_late_codes(Frame &f, Run &run, Shared &shared)
{
    read_raw(run, shared.lanes, 3 * f.count, [&](unsigned i) { return f.color_classes[i] > 0 ? 1u : 0u; },
             [&](unsigned i, unsigned negative) { f.colors[i] *= negative ? -1 : 1; });
    read_raw(run, shared.lanes, f.count, [&](unsigned n) { return window_of(f, shared, 2, n).low_bits; },
             [&](unsigned n, unsigned low) { f.shapes[2 * f.count + n] += low; });
    in_turn(2 * f.count, [&](unsigned i) { f.places[i] = 0; });
    __syncthreads();
    read_raw(run, shared.lanes, 2 * f.count, [&](unsigned i) { return place_bits(f, i); },
             [&](unsigned i, unsigned place) { f.places[i] = place; });
}

/* ---- The run */

/* R-15.6-2, where `late` bits follow the last symbol; then they are what is read next. */
static __device__ void begin_late(Run &run, Shared &shared, unsigned late)
{
    unsigned carried = min(run.lanes, late / 16), end = run.at + late - 16 * carried, size = (end + 7) / 8;
    in_turn(run.lanes, [&](unsigned lane) {
        unsigned x = shared.lanes.states[lane];
        if (lane < carried ? x >= 2 * LOWEST_STATE : x != LOWEST_STATE)
            atomicMin(&shared.wrong_lane, lane);
    });
    __syncthreads();
    if (threadIdx.x == 0) {
        Lanes &lanes = shared.lanes;
        unsigned last = run.groups - 1;
        bool words = lanes.taken[last] <= lanes.ends[last + 1];
        ROLLED for (unsigned group = 0; group < last; group++)
            words = words && lanes.taken[group] == lanes.ends[group + 1];
        if (!words)
            refuse(shared.status, R_7_1, 8 * shared.first_word);
        if (shared.wrong_lane < run.lanes)
            refuse(shared.status, R_7_1, 8 * (shared.text_at + 4 * shared.wrong_lane));
        if (2 * lanes.taken[last] + size != run.raw.size || (end % 8 > 0 && run.raw.text[run.raw.size - size] >> end % 8))
            refuse(shared.status, R_7_1, 8 * (shared.first_word + run.raw.size) - 8);
    }
    __syncthreads();
    run.raw.carried = 16 * carried;
    run.raw.early = run.at;
    run.at = 0;
}

static __device__ void read_passes(Frame &f, Run &run, Shared &shared, const Tables &tables, bool own_field,
                                   const State *states, const unsigned char *past)
{
    bool predicted = f.before > 0, adds = f.count > 0;
    unsigned passes = max(predicted ? 6u : 0u, adds ? f.halvings + 3 : 0u);
    ROLLED for (run.pass = 1; run.pass <= passes; run.pass++) {
        unsigned pass = run.pass;
        run.place = 0;
        if (predicted && pass <= 2 && own_field)
            read_vectors(f, run, shared, pass - 1);
        if (predicted && pass == 3)
            read_modes(f, run, shared, states, past);
        if (predicted && pass >= 4 && pass <= 6)
            read_components(f, run, shared, pass - 4);
        if (adds && pass <= f.halvings)
            read_halves(f, run, shared, tables, pass - 1);
        if (adds && pass == f.halvings + 1)
            read_luma(f, run, shared);
        if (adds && pass == f.halvings + 2)
            read_chroma(f, run, shared);
        if (adds && pass == f.halvings + 3)
            read_shapes(f, run, shared);
        if (predicted && pass <= 2 && own_field)        /* and then the early raw values */
            read_vector_bits(f, run, shared, pass - 1);
        if (predicted && pass == 2 && own_field)
            add_up_vectors(f.vectors, f.field.columns, f.field.rows);
        if (adds && pass <= f.halvings)
            read_half_bits(f, run, shared, pass - 1);
        if (adds && pass == f.halvings + 1)
            read_color_bits(f, run, shared, 0, f.count);
        if (adds && pass == f.halvings + 2)
            read_color_bits(f, run, shared, f.count, 3 * f.count);
        if (adds && pass == f.halvings + 3)
            read_raw(run, shared.lanes, 2 * f.count,
                     [&](unsigned i) {
                         unsigned aspect = i >= f.count;
                         return window_of(f, shared, aspect, aspect ? i - f.count : i).low_bits;
                     },
                     [&](unsigned i, unsigned low) { f.shapes[i] += low; });
    }
}

/* ---- The frame after it */

/* The splats that stay, in their order; how many they are. */
static __device__ unsigned stay(Frame &f, const Tables &tables, const State *states, State *after, unsigned char *past)
{
    Share own = share_of(f.before);
    unsigned there = 0;
    ROLLED for (unsigned n = own.first; n < own.end; n++)
        there += f.modes[n] != REMOVED;
    uint2 found = sum_before(there);
    ROLLED for (unsigned n = own.first; n < own.end; n++) {
        if (f.modes[n] == REMOVED)
            continue;
        int q[8];
        for (int c = 0; c < 8; c++)
            q[c] = f.differences[c * f.before + n];
        after[found.x] = inter_state(tables, states[n], f.motion[n], q, f.D);
        past[found.x++] = f.modes[n] > 0;
    }
    return found.y;
}

static __device__ void add_splats(Frame &f, State *after, unsigned char *past, unsigned char mark)
{
    in_turn(f.count, [&](unsigned n) {
        int cell[2] = {(int)(f.cells[n] & 0xFFFF), (int)(f.cells[n] >> 16)}, color[3], shape[3], place[2];
        for (int c = 0; c < 3; c++) {
            color[c] = f.colors[c * f.count + n];
            shape[c] = f.shapes[c * f.count + n];
        }
        for (int axis = 0; axis < 2; axis++)
            place[axis] = f.places[axis * f.count + n];
        after[n] = intra_state(cell, color, shape, place, f.D);
        past[n] = mark;
    });
}

/* The next piece of the workspace. */
template <class T> static __device__ T *taken(unsigned char *&workspace, size_t count)
{
    T *piece = (T *)workspace;
    workspace += (count * sizeof(T) + 15) / 16 * 16;
    return piece;
}

static __device__ void begin_frame(Frame &f, const Told &told, const Status &status, const Tables &tables,
                                   const FieldHead *inherited, FieldHead *field, unsigned char *workspace)
{
    bool sound = status.rule == SOUND;
    f.width = told.width;
    f.height = told.height;
    f.D = step_of(tables, sound ? status.quantizer : 0);
    f.before = status.before;
    f.count = sound ? status.new_count : 0;
    f.halvings = halving_count(f.width, f.height);
    f.parts = 1;
    int side = SIDES[sound ? status.motion_cell : 0];
    *field = {side, side > 0 ? (f.width + side - 1) / side : 0, side > 0 ? (f.height + side - 1) / side : 0, 0};
    const FieldHead *head = side > 0 || !inherited ? field : inherited;
    f.field = {head->side, head->columns, head->rows, (const int2 *)(head + 1)};
    f.vectors = (int2 *)(field + 1);
    f.vector_classes = taken<unsigned char>(workspace, field->columns * field->rows);
    f.motion = taken<int2>(workspace, f.before);
    f.contexts = taken<unsigned char>(workspace, f.before);
    ROLLED for (int group = 0; group < 3; group++)
        f.changed[group] = taken<unsigned>(workspace, f.before);
    for (int c = 0; c < 8; c++)
        f.classes[c] = taken<unsigned char>(workspace, f.before);
    f.part[0] = taken<Part>(workspace, f.count);
    f.part[1] = taken<Part>(workspace, f.count);
    f.asked = taken<unsigned>(workspace, f.count);
    f.first = taken<unsigned>(workspace, f.count);
    f.cells = taken<unsigned>(workspace, f.count);
    f.magnitudes = taken<unsigned short>(workspace, (1 + 2 * MAGNITUDES) * (MAGNITUDES + 1));
    f.windows = taken<unsigned short>(workspace, 3 * CLASSES * WINDOW_MOST);
    f.color_classes = taken<unsigned char>(workspace, 3 * f.count);
    f.splat_classes = taken<unsigned char>(workspace, f.count);
    f.colors = taken<int>(workspace, 3 * f.count);
    f.shapes = taken<int>(workspace, 3 * f.count);
    f.places = taken<int>(workspace, 2 * f.count);
}

/* R-6.2-2: each thread has the remainder of its bytes, times x to the number of bits behind them. */
static __device__ void compare_checksum(const unsigned char *text, unsigned size, Shared &shared)
{
    in_turn(256, [&](unsigned byte) {
        unsigned value = byte;
        ROLLED for (int bit = 0; bit < 8; bit++)
            value = shifted(value);
        shared.crc_table[byte] = value;
    });
    if (threadIdx.x == 0) {
        shared.crc = 0;
        shared.crc_powers[0] = X_TO_8;
        ROLLED for (int k = 1; k < 32; k++)
            shared.crc_powers[k] = crc_product(shared.crc_powers[k - 1], shared.crc_powers[k - 1]);
    }
    __syncthreads();
    Share own = share_of(size);
    unsigned remainder = own.first == 0 ? 0xFFFFFFFFu : 0, behind = size - own.end;
    ROLLED for (unsigned i = own.first; i < own.end; i++)
        remainder = remainder >> 8 ^ shared.crc_table[(remainder ^ text[i]) & 0xFF];
    ROLLED for (int k = 0; behind >> k != 0; k++)
        if (behind >> k & 1)
            remainder = crc_product(remainder, shared.crc_powers[k]);
    if (own.first < own.end)
        atomicXor(&shared.crc, remainder);
    __syncthreads();
    unsigned stated = text[size] | text[size + 1] << 8 | text[size + 2] << 16 | (unsigned)text[size + 3] << 24;
    if (threadIdx.x == 0 && ~shared.crc != stated)
        refuse(shared.status, R_6_2_2, 8 * size);
}

/* The elements in front of the words. */
static __device__ void read_elements(const unsigned char *text, const Told &told, const Layer &layer, unsigned halvings,
                                     Shared &shared)
{
    Status &status = shared.status;
    Bits p = {text, 8 * told.body_at, 8 * told.end, 0, &status};
    if (threadIdx.x == 0) {
        read_head(p, told, layer, status);
        if (status.densities_present)
            read_densities(p, halvings, shared);
        shared.text_at = p.at / 8;
        if (status.new_count + layer.count > 0)
            p.fits(32u << status.lane_exponent, p.at);
        else if (p.at < p.end)
            refuse(status, R_6_2_3, p.at);
    }
    __syncthreads();
    if (status.rule != SOUND || status.new_count + layer.count == 0)
        return;
    unsigned lanes = 1u << status.lane_exponent;
    in_turn(lanes, [&](unsigned lane) {
        const unsigned char *own = text + shared.text_at + 4 * lane;
        unsigned x = own[0] | own[1] << 8 | own[2] << 16 | (unsigned)own[3] << 24;
        shared.lanes.states[lane] = x;
        if (x < LOWEST_STATE)
            atomicMin(&shared.wrong_lane, lane);
    });
    __syncthreads();
    if (threadIdx.x == 0) {
        if (shared.wrong_lane < lanes)
            refuse(status, R_6_6_5, 8 * (shared.text_at + 4 * shared.wrong_lane));
        p.at = 8 * (shared.text_at + 4 * lanes);
        read_word_counts(p, max(1u, lanes / GROUP), shared.lanes);
        shared.first_word = p.at / 8;
    }
    __syncthreads();
}

/* The run, and the splats after the frame. */
static __device__ void read_run(const Told &told, const Tables &tables, const Layer &layer, const State *states,
                                const unsigned char *past, State *states_after, unsigned char *past_after, Run &run,
                                Shared &shared)
{
    Frame &f = shared.frame;
    if (f.before > 0)
        in_turn(ROWS, [&](unsigned row) { context_frequencies(layer.counts[row], symbols_of(row), shared.cumulative[row]); });
    if (f.count > 0) {
        if (threadIdx.x == 0)
            f.part[0][0] = {0, f.count};
        make_frequencies(f, shared, tables);
    }
    __syncthreads();
    read_passes(f, run, shared, tables, shared.status.motion_cell > 0, states, past);
    unsigned late = f.before > 0 ? late_bits_of_differences(f) : 0;
    late += f.count > 0 ? late_bits_of_codes(f, shared) : 0;
    begin_late(run, shared, sum_before(late).y);
    if (shared.status.rule != SOUND)
        return;
    unsigned staying = 0;
    if (f.before > 0) {
        read_late_differences(f, run, shared);
        staying = stay(f, tables, states, states_after, past_after);
    }
    if (f.count > 0) {
        locate_splats(f.part[f.halvings % 2], f.parts, f.cells);
        read_late_codes(f, run, shared);
        add_splats(f, states_after + staying, past_after + staying, told.intra ? 0 : 2);
    }
    __syncthreads();
    ROLLED for (int k = 0; k < 2; k++) {
        unsigned long long work = 0;
        in_turn(staying + f.count, [&](unsigned n) {
            work += work_of(tables, states_after[n], f.width, f.height, k * told.halvings);
        });
        atomicAdd(&shared.status.works[k], work);
    }
    if (threadIdx.x == 0) {
        shared.status.count = staying + f.count;
        shared.status.symbols = run.decoded;
    }
    __syncthreads();
}

/* One block of whole warps. `states`, `past` and `layer` are those before the frame, of an I those without splats; `modes`
   and `differences` have those of the splats before; `trace` is null or has room for all symbols. */
extern "C" __global__ void __launch_bounds__(1024)
read_body(const unsigned char *text, Told told, const Tables *tables, const Layer *layer, const State *states,
          const unsigned char *past, const FieldHead *inherited, Layer *layer_after, State *states_after,
          unsigned char *past_after, FieldHead *field, unsigned char *modes, int *differences, unsigned char *workspace,
          ushort4 *trace, Status *status)
{
    __shared__ Shared shared;
    if (threadIdx.x == 0) {
        shared.status = {};
        shared.status.before = layer->count;
        shared.wrong_lane = MOST_LANES;
    }
    in_turn(ROWS * SYMBOLS, [&](unsigned at) { (&shared.seen[0][0])[at] = 0; });
    in_turn(6, [&](unsigned at) { shared.planes[at] = layer->planes[at]; });
    in_turn(32, [&](unsigned at) { shared.halving_codes[at] = layer->halving_codes[at]; });
    __syncthreads();
    if (told.checked > 0)
        compare_checksum(text, told.checked, shared);
    read_elements(text, told, *layer, halving_count(told.width, told.height), shared);
    const Status &found = shared.status;
    if (threadIdx.x == 0) {
        begin_frame(shared.frame, told, found, *tables, inherited, field, workspace);
        shared.frame.modes = modes;
        shared.frame.differences = differences;
    }
    __syncthreads();
    if (found.rule == SOUND && found.new_count + found.before > 0) {
        unsigned lanes = 1u << found.lane_exponent;
        RawBits raw = {text + shared.first_word, told.end - shared.first_word, 0, 0};
        Run run = {raw, lanes, max(1u, lanes / GROUP), 0, 0, 0, 0, trace};
        read_run(told, *tables, *layer, states, past, states_after, past_after, run, shared);
    }
    in_turn(ROWS, [&](unsigned row) {
        adapt_context(layer->counts[row], shared.seen[row], symbols_of(row), layer_after->counts[row]);
    });
    in_turn(6, [&](unsigned at) { layer_after->planes[at] = shared.planes[at]; });
    in_turn(32, [&](unsigned at) { layer_after->halving_codes[at] = shared.halving_codes[at]; });
    if (threadIdx.x == 0) {
        for (int k = 0; k < 2; k++)
            if (found.works[k] > told.work_limits[k])
                refuse(shared.status, k ? R_5_9 : R_5_4, 0);
        bool sound = found.rule == SOUND;
        if (!sound)
            shared.status.count = 0;
        layer_after->count = found.count;
        layer_after->quantizer = sound ? found.quantizer : 0;
        layer_after->has_densities = sound && (layer->has_densities || found.densities_present);
        *status = found;
    }
}

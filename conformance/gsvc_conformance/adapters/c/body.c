/* frame_body(): the passes of a frame, and what they make of the splats of a layer. */
#include <stdlib.h>
#include <string.h>

#include "decoder.h"

enum { REMOVED = 8 };
enum { LUMA, CHROMA_1, CHROMA_2, SIZE, ASPECT, SHEAR };
static const u32 group_first[4] = {0, 2, 5, 8}, group_rows[3] = {POSITION, SHAPE, COLOR};

/* The arrays of a frame: what a GPU would hold. */
struct frame {
    struct decoder *decoder;
    struct carried *layer;
    struct arena *memory;
    struct run run;
    struct body body;
    i32 D;
    /* The field, and the splats of the frame before. */
    bool own_field;
    u8 (*vector_classes)[2];
    u16 cumulative[ROWS][SYMBOLS + 1];
    u32 seen[ROWS][SYMBOLS];
    i32 (*motion)[2];
    u8 *contexts, (*classes)[8];
    /* New splats: the parts of the halves, and codes. */
    u32 halvings, size, parts;
    struct part { u32 origin[2], count, first; struct distribution half; u32 low_bits; } *part, *other;
    struct codes *codes;
    u8 (*color_classes)[3], *splat_classes;
    struct window windows[3][CLASSES];
};

static u32 symbols_of(u32 row) { return row >= MODE && row < POSITION ? MODES : SYMBOLS; }

static u32 modeled(struct frame *f, u32 row) {
    struct distribution d = {f->cumulative[row], symbols_of(row), 0, 0, 0, 0, 0, 0};
    u32 symbol = next_symbol(&f->run, &d);
    f->seen[row][symbol]++;
    return symbol;
}

i32 magnitude_of(u32 class, u32 low) {
    return (i32)(class < 4 ? class : ((2 + class % 2) << magnitude_low_bits(class)) + low);
}

/* The predicted part. */

static void read_vectors(struct frame *f, u32 axis) {
    struct field *field = &f->body.field;
    u32 cells = field->columns * field->rows;
    for (u32 cell = 0; cell < cells; cell++) {
        u32 x = f->vector_classes[cell][0];
        f->vector_classes[cell][axis] = (u8)modeled(f, VECTOR + (axis ? x ? x <= 2 ? 2 : x <= 7 ? 3 : 4 : 1 : 0));
    }
}

static void read_vector_bits(struct frame *f, u32 axis) {
    struct field *field = &f->body.field;
    u32 cells = field->columns * field->rows;
    for (u32 cell = 0; cell < cells; cell++) {
        u32 class = f->vector_classes[cell][axis];
        field->vectors[cell][axis] = magnitude_of(class, early_bits(&f->run, magnitude_low_bits(class)));
    }
    for (u32 cell = 0; cell < cells; cell++) {
        i32 *vector = &field->vectors[cell][axis];
        if (*vector && early_bits(&f->run, 1)) *vector = -*vector;
    }
}

void add_up_vectors(struct field *field) {          /* prefix sums modulo 2^16: down the first column, along rows */
    for (u32 cell = 0; cell < field->columns * field->rows; cell++) {
        if (cell == 0) continue;
        const i32 *before = field->vectors[cell % field->columns ? cell - 1 : cell - field->columns];
        for (u32 axis = 0; axis < 2; axis++) {
            u32 sum = (u32)(field->vectors[cell][axis] + before[axis]) + (1u << 15);
            field->vectors[cell][axis] = (i32)(sum & 0xFFFF) - (1 << 15);
        }
    }
    find_unrest(field);
}

static void read_modes(struct frame *f) {
    const struct header *h = &f->decoder->header;
    if (f->own_field) add_up_vectors(&f->body.field);
    for (u32 n = 0; n < f->body.before; n++) {
        const struct splat *splat = &f->layer->splats[n];
        motion_of(splat, &f->body.field, f->motion[n]);
        f->contexts[n] = (u8)mode_context(splat, f->layer->past[n], f->motion[n], &f->body.field, h->width, h->height);
    }
    for (u32 n = 0; n < f->body.before; n++) f->body.modes[n] = (u8)modeled(f, MODE + f->contexts[n]);
}

static bool changes(const struct frame *f, u32 n, u32 group) {
    return f->body.modes[n] != REMOVED && f->body.modes[n] >> group & 1;
}

static u32 sum_before(const struct frame *f, u32 n, u32 group, u32 i) { /* the least of 2 and a: classes tell it */
    u32 sum = 0;
    for (u32 k = 0; k < i; k++) sum += f->classes[n][group_first[group] + k];
    return sum < 2 ? sum : 2;
}

static void read_components(struct frame *f, u32 i) { /* the i-th ones of position, shape and colour */
    for (u32 group = 0; group < 3; group++) {       /* the items are lists: a prefix sum over the bits of modes */
        if (group_first[group] + i >= group_first[group + 1]) continue;
        for (u32 n = 0; n < f->body.before; n++) {
            if (!changes(f, n, group)) continue;
            u32 context = i ? 3 * (i - 1) + 1 + sum_before(f, n, group, i) : 0;
            f->classes[n][group_first[group] + i] = (u8)modeled(f, group_rows[group] + context);
        }
    }
}

static void read_late_differences(struct frame *f) {
    for (u32 group = 0; group < 3; group++) {
        for (u32 at = group_first[group]; at < group_first[group + 1]; at++) {
            bool last = at + 1 == group_first[group + 1];
            for (u32 n = 0; n < f->body.before; n++) {
                if (!changes(f, n, group)) continue;
                u32 class = f->classes[n][at], coded = late_bits(&f->run, magnitude_low_bits(class));
                bool least_is_1 = last && sum_before(f, n, group, at - group_first[group]) == 0;
                f->body.differences[n][at] = magnitude_of(class, coded) + least_is_1;
            }
            for (u32 n = 0; n < f->body.before; n++) {
                i32 *difference = &f->body.differences[n][at];
                if (*difference && late_bits(&f->run, 1)) *difference = -*difference;
            }
        }
    }
}

/* New splats. */

static void begin_halves(struct frame *f) {
    f->size = 1u << f->halvings / 2;
    f->part = take(f->memory, f->body.count, sizeof *f->part);
    f->other = take(f->memory, f->body.count, sizeof *f->other);
    f->parts = 1;
    f->part[0].count = f->body.count;
}

static u32 inside(const struct frame *f, u32 axis) {
    return ((axis ? f->decoder->header.height : f->decoder->header.width) + 3) / 4;
}

static u32 halvings_of(const struct frame *f) {
    return 2 * bit_length((inside(f, 0) > inside(f, 1) ? inside(f, 0) : inside(f, 1)) - 1);
}

static void read_halves(struct frame *f, u32 halving) {
    u32 axis = halving % 2, cells = inside(f, axis);
    if (axis == 0) f->size /= 2;
    for (u32 n = 0; n < f->parts; n++) {            /* who is asked; its half is `first` */
        struct part *part = &f->part[n];
        u32 middle = part->origin[axis] + f->size, q = middle < cells ? cells - middle : 0;
        part->half.bins = 0;
        if (q > f->size) q = f->size;
        if (q) part->half = half_of(part->count, f->size, q, f->layer->alpha[halving], &part->low_bits);
    }
    for (u32 n = 0; n < f->parts; n++) {
        struct part *part = &f->part[n];
        part->first = part->half.bins ? next_symbol(&f->run, &part->half) << part->low_bits : part->count;
    }
}

static void split_parts(struct frame *f, u32 axis) { /* each becomes two; empty ones go: a prefix sum */
    u32 parts = 0;
    for (u32 n = 0; n < f->parts; n++) {
        for (u32 second = 0; second < 2; second++) {
            struct part half = f->part[n];
            if (half.first > half.count) half.first = half.count;
            half.count = second ? half.count - half.first : half.first;
            half.origin[axis] += second * f->size;
            if (half.count) f->other[parts++] = half;
        }
    }
    struct part *old = f->part;
    f->part = f->other, f->other = old, f->parts = parts;
}

static void read_half_bits(struct frame *f, u32 halving) {
    for (u32 n = 0; n < f->parts; n++) {
        struct part *part = &f->part[n];
        if (part->half.bins) part->first += early_bits(&f->run, part->low_bits);
    }
    split_parts(f, halving % 2);
}

static void begin_codes(struct frame *f) {
    f->codes = take(f->memory, f->body.count, sizeof *f->codes);
    f->color_classes = take(f->memory, f->body.count, sizeof *f->color_classes);
    f->splat_classes = take(f->memory, f->body.count, sizeof *f->splat_classes);
    u32 n = 0;
    for (u32 k = 0; k < f->parts; k++) {            /* the first splat of a part: a prefix sum of counts */
        for (u32 i = 0; i < f->part[k].count; i++, n++) {
            f->codes[n].column = (i32)f->part[k].origin[0], f->codes[n].row = (i32)f->part[k].origin[1];
        }
    }
}

void cells_of_halves(struct arena *memory, u32 width, u32 height, u32 count, const i32 *first, i32 (*cells)[2]) {
    struct frame *f = take(memory, 1, sizeof *f);
    f->decoder = take(memory, 1, sizeof *f->decoder), f->memory = memory, f->body.count = count;
    f->decoder->header.width = width, f->decoder->header.height = height;
    f->halvings = halvings_of(f);
    begin_halves(f);
    for (u32 halving = 0; halving < f->halvings; halving++) {
        u32 axis = halving % 2;
        if (axis == 0) f->size /= 2;
        for (u32 n = 0; n < f->parts; n++, first++) {
            struct part *part = &f->part[n];
            part->first = part->origin[axis] + f->size < inside(f, axis) ? (u32)*first : part->count;
        }
        split_parts(f, axis);
    }
    begin_codes(f);
    for (u32 n = 0; n < count; n++) cells[n][0] = f->codes[n].column, cells[n][1] = f->codes[n].row;
}

static void read_colors(struct frame *f, u32 c) {
    const struct plane *plane = &f->layer->planes[LUMA + c];
    for (u32 n = 0; n < f->body.count; n++) {
        i32 centre = plane->centre + (c ? floor_shift(plane->slope * f->color_classes[n][0], 2) : 0);
        struct distribution d = magnitude_density(plane->family, plane->scale_code, centre);
        f->color_classes[n][c] = (u8)next_symbol(&f->run, &d);
    }
}

static void read_color_bits(struct frame *f, u32 c) {
    for (u32 n = 0; n < f->body.count; n++) {
        u32 class = f->color_classes[n][c];
        f->codes[n].color[c] = magnitude_of(class, early_bits(&f->run, magnitude_low_bits(class)));
    }
}

static void find_windows(struct frame *f) {         /* of each class and plane; the class needs no signs */
    for (u32 n = 0; n < f->body.count; n++) {
        i32 color[3];
        color_of(f->codes[n].color, f->D, color);
        f->splat_classes[n] = (u8)class_of(color, f->D);
    }
    for (u32 k = 0; k < 3; k++) {
        const struct plane *plane = &f->layer->planes[SIZE + k];
        for (i32 j = 0; j < CLASSES; j++) {
            i32 step = SIZE + k == SHEAR ? shear_step(j) : size_step(j), centre = 64 * plane->centre + 16 * plane->slope * j;
            f->windows[k][j] = window_of(centre, step, plane->family, plane->scale_code);
        }
    }
}

static void read_shapes(struct frame *f, u32 k) {
    for (u32 n = 0; n < f->body.count; n++) {
        const struct window *window = &f->windows[k][f->splat_classes[n]];
        i32 bin = window->first + (i32)next_symbol(&f->run, &window->bins);
        f->codes[n].shape[k] = bin * (1 << window->low_bits);
    }
}

static void read_shape_bits(struct frame *f, u32 k, u32 (*bits)(struct run *, u32)) {
    for (u32 n = 0; n < f->body.count; n++) {
        f->codes[n].shape[k] += (i32)bits(&f->run, f->windows[k][f->splat_classes[n]].low_bits);
    }
}

static void read_late_codes(struct frame *f) {
    for (u32 c = 0; c < 3; c++) {
        for (u32 n = 0; n < f->body.count; n++) {
            i32 *k = &f->codes[n].color[c];
            if (*k && late_bits(&f->run, 1)) *k = -*k;
        }
    }
    read_shape_bits(f, 2, late_bits);
    for (i32 axis = 0; axis < 2; axis++) {
        for (u32 n = 0; n < f->body.count; n++) {
            f->codes[n].place[axis] = (i32)late_bits(&f->run, place_bits(&f->codes[n], f->splat_classes[n], axis));
        }
    }
}

/* Passes: the symbols of pass t of the predicted part and of the new splats, then the early bits of both. */

static void predicted_symbols(struct frame *f, u32 pass) {
    if (pass <= 2 && f->own_field) read_vectors(f, pass - 1);
    if (pass == 3) read_modes(f);
    if (pass >= 4 && pass <= 6) read_components(f, pass - 4);
}

static void new_symbols(struct frame *f, u32 pass) {
    if (pass == 1) begin_halves(f);
    if (pass <= f->halvings) read_halves(f, pass - 1);
    if (pass == f->halvings + 1) begin_codes(f), read_colors(f, 0);
    if (pass == f->halvings + 2) read_colors(f, 1), read_colors(f, 2);
    if (pass == f->halvings + 3) find_windows(f), read_shapes(f, 0), read_shapes(f, 1), read_shapes(f, 2);
}

static void new_bits(struct frame *f, u32 pass) {
    if (pass <= f->halvings) read_half_bits(f, pass - 1);
    if (pass == f->halvings + 1) read_color_bits(f, 0);
    if (pass == f->halvings + 2) read_color_bits(f, 1), read_color_bits(f, 2);
    if (pass == f->halvings + 3) read_shape_bits(f, 0, early_bits), read_shape_bits(f, 1, early_bits);
}

static void read_run(struct frame *f, struct bits *bits) {
    bool predicted = f->body.before > 0, new = f->body.count > 0;
    u32 passes = predicted ? 6 : 0;
    if (new && f->halvings + 3 > passes) passes = f->halvings + 3;
    begin_run(&f->run, bits, f->body.lane_exponent);
    for (u32 pass = 1; pass <= passes; pass++) {
        begin_pass(&f->run, pass);
        if (predicted) predicted_symbols(f, pass);
        if (new) new_symbols(f, pass);
        if (predicted && pass <= 2 && f->own_field) read_vector_bits(f, pass - 1);
        if (new) new_bits(f, pass);
    }
    for (u32 reading = 0; reading < 2; reading++) {
        begin_late(&f->run, !reading);
        if (predicted) read_late_differences(f);
        if (new) read_late_codes(f);
    }
    finish_run(&f->run);
    bits->at = 8 * bits->size;
}

/* The body. */

static void read_densities(struct frame *f, struct bits *bits) {
    for (u32 k = 0; k < 6; k++) {
        struct plane *plane = &f->layer->planes[k];
        plane->family = read_u(bits, 1);
        plane->scale_code = read_u(bits, 5);
        plane->centre = (i32)read_u(bits, 10) - 512;
        plane->slope = k == LUMA || k == SHEAR ? 0 : (i32)read_u(bits, 8) - 128;
    }
    for (u32 k = 0; k < f->halvings; k++) f->layer->alpha[k] = (u8)read_u(bits, 3);
    if (bits->at % 8 && read_u(bits, 8 - bits->at % 8)) fault(f->decoder, "R-3.1-4", bits->element);
    f->layer->has_densities = true;
}

static void read_head(struct frame *f, struct bits *bits, char type, u32 number, u64 others) {
    struct decoder *d = f->decoder;
    struct carried *layer = f->layer;
    struct body *body = &f->body;
    body->lane_exponent = read_u(bits, 4);
    if (body->lane_exponent > 12) fault(d, "R-3.2-1", bits->element);
    if (body->lane_exponent > d->header.max_lane_exponent) fault(d, "R-15.5-1", bits->element);
    body->motion_cell = read_u(bits, 2);
    if (body->motion_cell && !layer->count) fault(d, "R-15.5-2", bits->element);
    bool quantizer_present = read_u(bits, 1);
    if (type == 'I' && !quantizer_present) fault(d, "R-15.5-5", bits->element);
    bool new_present = read_u(bits, 1);
    if (quantizer_present) {
        layer->quantizer = read_le(bits, 1);
        if (layer->quantizer > 79) fault(d, "R-3.2-1", bits->element);
    }
    if (new_present) {
        u32 splat_number = read_uv(bits);
        body->densities_present = splat_number & 1;
        body->count = splat_number / 2 + 1;
    }
    check_splats(d, (u64)body->count + layer->count + others, bits->element);
    if (body->count && !body->densities_present && type == 'I') fault(d, "R-15.5-3", bits->element);
    if (body->count && !body->densities_present && !layer->has_densities) fault(d, "R-15.5-4", bits->element);
    if (body->motion_cell == 0 && number > 0 && type == 'P') body->field = d->base_field;
}

static void begin_predicted(struct frame *f) {
    struct body *body = &f->body;
    f->own_field = body->motion_cell > 0;
    if (f->own_field) {
        const struct header *h = &f->decoder->header;
        u32 cell = body->motion_cell, columns = cells_of(h->width, cell), rows = cells_of(h->height, cell);
        struct field field = {columns, rows, cell, NULL, NULL};
        field.vectors = take(f->memory, columns * rows, sizeof *field.vectors);
        field.unrest = take(f->memory, columns * rows, sizeof *field.unrest);
        f->vector_classes = take(f->memory, columns * rows, sizeof *f->vector_classes);
        body->field = field;
    }
    f->motion = take(f->memory, body->before, sizeof *f->motion);
    f->contexts = take(f->memory, body->before, sizeof *f->contexts);
    f->classes = take(f->memory, body->before, sizeof *f->classes);
    body->modes = take(f->memory, body->before, sizeof *body->modes);
    body->differences = take(f->memory, body->before, sizeof *body->differences);
    for (u32 row = 0; row < ROWS; row++) model_frequencies(f->layer->counts[row], symbols_of(row), f->cumulative[row]);
}

static void next_splats(struct frame *f, char type) { /* those that stay, and after them the new ones */
    struct carried *layer = f->layer;
    u32 count = 0;
    for (u32 n = 0; n < f->body.before; n++) {      /* to the front: a prefix sum over modes */
        if (f->body.modes[n] == REMOVED) continue;
        struct splat splat = inter_state(&layer->splats[n], f->motion[n], f->body.differences[n], f->D);
        layer->past[count] = f->body.modes[n] != 0;
        layer->splats[count++] = splat;
    }
    u64 room = (u64)count + f->body.count;
    layer->splats = realloc(layer->splats, (room + 1) * sizeof *layer->splats);
    layer->past = realloc(layer->past, room + 1);
    if (!layer->splats || !layer->past) abort();
    for (u32 n = 0; n < f->body.count; n++) {
        layer->splats[count] = intra_state(&f->codes[n], f->D);
        layer->past[count++] = type == 'I' ? 0 : 2;
    }
    layer->count = count;
}

void read_body(struct decoder *decoder, struct bits *bits, char type, u32 number, u64 others) {
    struct arena *memory = number ? &decoder->layer_memory : &decoder->base_memory;
    struct frame *f = take(memory, 1, sizeof *f);
    f->decoder = decoder, f->memory = memory, f->layer = &decoder->layers[number];
    if (type == 'I') {                              /* R-15.11-1 */
        f->layer->count = 0;
        f->layer->has_densities = false;
        for (u32 row = 0; row < ROWS; row++) {
            for (u32 s = 0; s < SYMBOLS; s++) f->layer->counts[row][s] = first_counts[row][s];
        }
    }
    f->halvings = halvings_of(f);
    f->body.before = f->layer->count;
    read_head(f, bits, type, number, others);
    if (f->body.densities_present) read_densities(f, bits);
    f->D = step_of(f->layer->quantizer);
    if (f->body.before) begin_predicted(f);
    if (f->body.before + f->body.count) read_run(f, bits);
    for (u32 row = 0; row < ROWS; row++) adapt_model(f->layer->counts[row], f->seen[row], symbols_of(row));
    next_splats(f, type);
    if (number == 0) decoder->base_field = f->body.field;
    if (number == 0 && decoder->on_body) decoder->on_body(decoder->reader, decoder, &f->body);
}

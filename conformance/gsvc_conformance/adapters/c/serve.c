/* The protocols of the kit (protocol.md), for little-endian machines: arrays as .npy files, and a process for one
   vector (gsvc-main OPERATION IN OUT) or for all of them (gsvc-main --serve). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "decoder.h"

#ifndef FLAGS
#define FLAGS "unknown"
#endif

typedef int64_t i64;

static char in_dir[4096], out_dir[4096];
static struct arena memory;                         /* of one vector */

static FILE *open_file(const char *folder, const char *name, const char *mode) {
    char path[4200];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, mode);
    if (!file) { perror(path); exit(1); }
    return file;
}

static u8 *read_file(const char *name, u64 *size) {
    FILE *file = open_file(in_dir, name, "rb");
    fseek(file, 0, SEEK_END);
    *size = (u64)ftell(file);
    rewind(file);
    u8 *data = take(&memory, *size + 1, 1);
    if (fread(data, 1, *size, file) != *size) { perror(name); exit(1); }
    fclose(file);
    return data;
}

struct input { u64 rows, columns, size; const i64 *numbers; i32 *narrow; }; /* i8 (rows, columns, ...), `size` in all */

static struct input read_input(const char *name) {
    char path[80];
    u64 bytes;
    snprintf(path, sizeof path, "%s.npy", name);
    const u8 *data = read_file(path, &bytes);
    u64 first = 10 + u16_at(data + 8);              /* version 1.0 */
    struct input input = {1, 1, (bytes - first) / 8, (const i64 *)(const void *)(data + first), NULL};
    unsigned long long rows = 1, columns = 1;
    const char *shape = strstr((const char *)data + 10, "'shape': (");
    if (shape) sscanf(shape, "'shape': (%llu, %llu", &rows, &columns);
    input.rows = rows, input.columns = columns;
    input.narrow = take(&memory, input.size + 1, sizeof *input.narrow);
    for (u64 n = 0; n < input.size; n++) input.narrow[n] = (i32)input.numbers[n];
    return input;
}

static i32 read_int(const char *name) { return read_input(name).narrow[0]; }

static u32 read_size(const char *name) { return (u32)read_int(name); }

/* An array that is written row by row: its head is written last, when the rows are counted. */
struct output {                                     /* columns 0: of one dimension; pairs: the columns are pairs */
    FILE *file;
    const char *type;
    u64 rows, columns;
    size_t size;
    bool pairs;
};

static struct output begin_output(const char *name, const char *type, u64 columns) {
    char path[80], head[128] = "";
    snprintf(path, sizeof path, "%s.npy", name);
    struct output output = {open_file(out_dir, path, "wb"), type, 0, columns, (size_t)(type[2] - '0'), false};
    fwrite(head, 1, sizeof head, output.file);
    return output;
}

static void add_rows(struct output *output, const void *rows, u64 count) {
    output->rows += count;
    fwrite(rows, output->size, count * (output->columns ? output->columns : 1), output->file);
}

static void add_narrow(struct output *output, const i32 *numbers, u64 count) { /* those of 32 bits as i8 */
    u64 columns = output->columns ? output->columns : 1;
    output->rows += count;
    for (u64 n = 0; n < count * columns; n++) {
        i64 wide = numbers[n];
        fwrite(&wide, sizeof wide, 1, output->file);
    }
}

static void end_output(struct output *output) {     /* the data begins at a multiple of 64 bytes */
    char shape[64] = "", text[118];
    if (output->columns) snprintf(shape, sizeof shape, "%llu", (unsigned long long)output->columns);
    if (output->pairs) snprintf(shape, sizeof shape, "%llu, 2", (unsigned long long)output->columns / 2);
    snprintf(text, sizeof text, "{'descr': '%s', 'fortran_order': False, 'shape': (%llu, %s), }", output->type,
             (unsigned long long)output->rows, shape);
    rewind(output->file);
    fprintf(output->file, "\x93NUMPY%c%c%c%c%-117s\n", 1, 0, 118, 0, text);
    if (ferror(output->file) || fclose(output->file)) { perror("an output"); exit(1); }
}

static void write_array(const char *name, const char *type, u64 columns, const void *rows, u64 count) {
    struct output output = begin_output(name, type, columns);
    add_rows(&output, rows, count);
    end_output(&output);
}

static void write_narrow(const char *name, u64 columns, const void *numbers, u64 count) {
    struct output output = begin_output(name, "<i8", columns);
    add_narrow(&output, numbers, count);
    end_output(&output);
}

static void write_number(const char *name, i64 number) {
    FILE *file = open_file(out_dir, name, "wb");
    fprintf(file, "\x93NUMPY%c%c%c%c%-117s\n", 1, 0, 118, 0, "{'descr': '<i8', 'fortran_order': False, 'shape': (), }");
    fwrite(&number, sizeof number, 1, file);
    if (fclose(file)) exit(1);
}

/* Streams. */

struct listing { /* of `reconstruct_stream`, and what `read_main_stream` has besides (`parameters` is not of it) */
    bool whole;
    struct output counts, parameters, frame_types, bodies, fields, modes, differences, states, symbols;
};

static void list_frame(void *reader, const struct decoder *decoder) {
    struct listing *listing = reader;
    i64 count = 0;
    for (u32 l = 0; l < 4; l++) {
        const struct carried *layer = &decoder->layers[l];
        if (!layer->there) continue;
        count += layer->count;
        if (listing->whole) add_narrow(&listing->states, &layer->splats[0].X, layer->count);
        for (u32 n = 0; n < layer->count && !listing->whole; n++) {
            float parameters[8];
            parameters_of(&layer->splats[n], parameters);
            add_rows(&listing->parameters, parameters, 1);
        }
    }
    add_rows(&listing->counts, &count, 1);
    if (listing->whole) add_rows(&listing->frame_types, &decoder->frame_type, 1);
}

static void list_body(void *reader, const struct decoder *decoder, const struct body *body) {
    struct listing *listing = reader;
    const i64 row[6] = {decoder->frame_number, decoder->layers[0].quantizer, body->lane_exponent,
                        body->motion_cell, body->densities_present, body->count};
    add_rows(&listing->bodies, row, 1);
    add_narrow(&listing->fields, (const i32 *)body->field.vectors, body->field.columns * body->field.rows);
    for (u32 n = 0; n < body->before; n++) add_narrow(&listing->modes, &(i32){body->modes[n]}, 1);
    add_narrow(&listing->differences, (const i32 *)body->differences, body->before);
}

static void list_symbol(void *reader, u32 start, u32 frequency, u32 pass, u32 lane) {
    struct listing *listing = reader;
    const u16 row[4] = {(u16)start, (u16)frequency, (u16)pass, (u16)lane};
    add_rows(&listing->symbols, row, 1);
}

static struct decoder *decoded(u32 quality, struct listing *listing) {
    u64 size;
    const u8 *stream = read_file("stream.gsvc", &size);
    struct decoder *decoder = take(&memory, 1, sizeof *decoder);
    listing->counts = begin_output("counts", "<i8", 0);
    decoder->quality = quality, decoder->reader = listing, decoder->on_frame = list_frame;
    if (listing->whole) decoder->on_body = list_body, decoder->on_symbol = list_symbol;
    decode(decoder, stream, size);
    end_output(&listing->counts);
    return decoder;
}

static void reconstruct_quality(u32 quality) {
    struct listing listing = {.parameters = begin_output("parameters", "<f4", 8)};
    const struct decoder *d = decoded(quality, &listing);
    end_output(&listing.parameters);
    FILE *error = open_file(out_dir, "error.txt", "w");
    if (d->rule) fprintf(error, "%s %s %llu", kind_of(d->rule), d->rule, (unsigned long long)d->bit);
    if (fclose(error)) exit(1);
}

static void reconstruct_stream(void) { reconstruct_quality(0); }

static void reconstruct_layers(void) { reconstruct_quality(read_size("layer")); }

static void read_main_stream(void) {
    struct listing listing = {
        .whole = true, .frame_types = begin_output("frame_types", "|u1", 0), .bodies = begin_output("bodies", "<i8", 6),
        .fields = begin_output("fields", "<i8", 2), .modes = begin_output("modes", "<i8", 0),
        .differences = begin_output("differences", "<i8", 8), .states = begin_output("states", "<i8", 8),
        .symbols = begin_output("symbols", "<u2", 4)};
    const struct decoder *decoder = decoded(0, &listing);
    struct output *outputs[] = {&listing.frame_types, &listing.bodies, &listing.fields, &listing.modes,
                                &listing.differences, &listing.states, &listing.symbols};
    for (u32 k = 0; k < sizeof outputs / sizeof *outputs; k++) end_output(outputs[k]);
    i64 header[28];
    for (u32 k = 0; k < decoder->header.element_count; k++) header[k] = decoder->header.elements[k];
    write_array("header", "<i8", 0, header, decoder->header.element_count);
}

/* Runs, distributions and models. */

struct raw { u32 early, late, in_states, bytes; u32 *states; u8 *tail; };

static void put_bits(struct raw *raw, struct input values, struct input sizes, bool late) {
    u32 at = 0;
    for (u64 n = 0; n < sizes.size; n++) {
        for (i64 bit = 0; bit < sizes.numbers[n]; bit++, at++) {
            u32 value = (u32)(values.numbers[n] >> bit) & 1, place = late ? raw->early + at - raw->in_states : at;
            if (late && at < raw->in_states) raw->states[at / 16] |= value << at % 16;
            else raw->tail[raw->bytes - 1 - place / 8] |= (u8)(value << place % 8);
        }
    }
}

static void encode_run(void) {                      /* R-15.6-3: the decoder backwards */
    struct input starts = read_input("starts"), frequencies = read_input("frequencies"), lanes = read_input("lanes");
    struct input early_sizes = read_input("early_sizes"), late_sizes = read_input("late_sizes");
    u32 lane_count = read_size("lane_count"), groups = lane_count > GROUP ? lane_count / GROUP : 1;
    struct raw raw = {0};
    for (u64 n = 0; n < early_sizes.size; n++) raw.early += (u32)early_sizes.numbers[n];
    for (u64 n = 0; n < late_sizes.size; n++) raw.late += (u32)late_sizes.numbers[n];
    raw.in_states = 16 * (u32)min_of((i32)lane_count, (i32)(raw.late / 16));
    raw.bytes = (raw.early + raw.late - raw.in_states + 7) / 8;
    raw.states = take(&memory, lane_count, sizeof *raw.states);
    raw.tail = take(&memory, raw.bytes + 1, 1);
    for (u32 lane = 0; lane < lane_count; lane++) raw.states[lane] = LOWEST_STATE;
    put_bits(&raw, read_input("early"), early_sizes, false);
    put_bits(&raw, read_input("late"), late_sizes, true);
    u16 *words = take(&memory, starts.size, sizeof *words), *ordered = take(&memory, starts.size, sizeof *words);
    u32 *group_of = take(&memory, starts.size, sizeof *group_of);
    i32 *counts = take(&memory, groups, sizeof *counts);
    u64 count = 0, filled = 0;
    for (u64 n = starts.size; n-- > 0;) {
        u32 lane = (u32)lanes.narrow[n], f = (u32)frequencies.narrow[n], x = raw.states[lane];
        if (x >> 18 >= f) {                         /* x >= f 2^18 */
            words[count] = (u16)x, group_of[count++] = lane / GROUP, counts[lane / GROUP]++;
            x >>= 16;
        }
        raw.states[lane] = x / f * TOTAL + x % f + (u32)starts.narrow[n]; /* (7-2) */
    }
    for (u32 group = 0; group < groups; group++) {
        for (u64 n = count; n-- > 0;) if (group_of[n] == group) ordered[filled++] = words[n];
    }
    write_array("lane_states", "<u4", 0, raw.states, lane_count);
    write_narrow("word_counts", 0, counts, groups);
    write_array("words", "<u2", 0, ordered, count);
    write_array("tail", "|u1", 0, raw.tail, raw.bytes);
}

static void write_cumulative(const struct distribution *d, const i32 *edges) { /* NULL: those that it has */
    i32 *numbers = take(&memory, d->bins + 1, sizeof *numbers);
    for (u32 bin = 0; bin <= d->bins; bin++) {
        bool inner = edges && bin && bin < d->bins;
        numbers[bin] = (i32)(inner ? density_at(d, bin, edges[bin - 1]) : cumulative_at(d, bin));
    }
    write_narrow("cumulative", 0, numbers, d->bins + 1);
}

static void density_frequencies(void) {
    struct input edges = read_input("edges");
    struct distribution d = {NULL, (u32)edges.size + 1, 0, 0, read_int("centre"), read_size("density_family"),
                             read_size("scale_code"), read_size("unit_bits")};
    write_cumulative(&d, edges.narrow);
}

static void window_frequencies(void) {
    struct window window =
        window_of(read_int("centre"), read_int("step"), read_size("density_family"), read_size("scale_code"));
    write_cumulative(&window.bins, NULL);
    write_number("first.npy", window.first);
    write_number("low_bits.npy", window.low_bits);
}

static void half_frequencies(void) {
    u32 low_bits, index = 0, alpha = read_size("alpha");
    while (index < ALPHAS - 1 && alphas[index] != alpha) index++;
    struct distribution d =
        half_of(read_size("count"), read_size("first_half"), read_size("second_half"), index, &low_bits);
    write_cumulative(&d, NULL);
    write_number("low_bits.npy", low_bits);
}

static void codes_of_classes(void) {
    struct input classes = read_input("classes"), low = read_input("low"), negative = read_input("negative");
    i32 *codes = take(&memory, classes.size, sizeof *codes);
    for (u64 n = 0; n < classes.size; n++) {
        i32 magnitude = magnitude_of((u32)classes.narrow[n], (u32)low.narrow[n]);
        codes[n] = negative.narrow[n] ? -magnitude : magnitude;
    }
    write_narrow("codes", 0, codes, classes.size);
}

static void find_cells(void) {
    u32 count = read_size("count");
    i32 (*cells)[2] = take(&memory, count, sizeof *cells);
    cells_of_halves(&memory, read_size("width"), read_size("height"), count, read_input("first_halves").narrow, cells);
    write_narrow("cells", 2, cells, count);
}

static void field_vectors(void) {
    struct input differences = read_input("differences");
    struct field field = {(u32)differences.columns, (u32)differences.rows, 1, NULL, NULL};
    field.vectors = (i32(*)[2])differences.narrow;
    field.unrest = take(&memory, differences.rows * differences.columns, 1);
    add_up_vectors(&field);
    struct output output = begin_output("vectors", "<i8", 2 * differences.columns);
    output.pairs = true;
    add_narrow(&output, (const i32 *)field.vectors, differences.rows);
    end_output(&output);
}

static void frequencies_of_models(void) {
    struct input counts = read_input("counts");
    u64 columns = counts.columns + 1;
    i32 *cumulative = take(&memory, counts.rows * columns, sizeof *cumulative);
    for (u64 row = 0; row < counts.rows; row++) {
        u16 found[SYMBOLS + 1];
        model_frequencies((const u32 *)counts.narrow + row * counts.columns, (u32)counts.columns, found);
        for (u64 s = 0; s < columns; s++) cumulative[row * columns + s] = found[s];
    }
    write_narrow("cumulative", columns, cumulative, counts.rows);
}

static void counts_of_models(void) {
    struct input counts = read_input("counts"), seen = read_input("seen");
    i64 *wide = take(&memory, counts.size, sizeof *wide);
    for (u64 row = 0; row < counts.rows; row++) {
        u32 *numbers = (u32 *)counts.narrow + row * counts.columns;
        adapt_model(numbers, (const u32 *)seen.narrow + row * counts.columns, (u32)counts.columns);
        for (u64 s = 0; s < counts.columns; s++) wide[row * counts.columns + s] = numbers[s];
    }
    write_array("counts", "<i8", counts.columns, wide, counts.rows);
}

/* Splats. */

static const struct splat *read_states(u64 *count) {
    struct input input = read_input("state");
    *count = input.rows;
    return (const struct splat *)input.narrow;
}

static struct field read_field(void) {
    struct input vectors = read_input("vectors");
    struct field field = {(u32)vectors.columns, (u32)vectors.rows, read_size("motion_cell"), NULL, NULL};
    field.vectors = (i32(*)[2])vectors.narrow;
    field.unrest = take(&memory, vectors.rows * vectors.columns, 1);
    if (field.cell) find_unrest(&field);
    return field;
}

static void mode_contexts(void) {
    u64 count;
    const struct splat *states = read_states(&count);
    const i32 *past = read_input("past").narrow, *motion = read_input("motion").narrow;
    struct field field = read_field();
    u32 width = read_size("width"), height = read_size("height");
    i32 *contexts = take(&memory, count, sizeof *contexts);
    for (u64 n = 0; n < count; n++) {
        contexts[n] = (i32)mode_context(&states[n], (u32)past[n], motion + 2 * n, &field, width, height);
    }
    write_narrow("contexts", 0, contexts, count);
}

static void motion_of_splats(void) {
    u64 count;
    const struct splat *states = read_states(&count);
    struct field field = read_field();
    i32 (*motion)[2] = take(&memory, count, sizeof *motion);
    for (u64 n = 0; n < count; n++) motion_of(&states[n], &field, motion[n]);
    write_narrow("motion", 2, motion, count);
}

static void splat_classes(void) {
    u64 count;
    const struct splat *states = read_states(&count);
    i32 D = step_of(read_size("quantizer")), *classes = take(&memory, count, sizeof *classes);
    for (u64 n = 0; n < count; n++) classes[n] = class_of(states[n].n, D);
    write_narrow("classes", 0, classes, count);
}

static void main_intra(void) {
    struct input cells = read_input("cells"), colors = read_input("colors");
    struct input shapes = read_input("shapes"), places = read_input("places");
    struct splat *states = take(&memory, cells.rows, sizeof *states);
    i32 D = step_of(read_size("quantizer"));
    for (u64 n = 0; n < cells.rows; n++) {
        struct codes codes = {.column = cells.narrow[2 * n], .row = cells.narrow[2 * n + 1]};
        for (u32 k = 0; k < 3; k++) codes.color[k] = colors.narrow[3 * n + k];
        for (u32 k = 0; k < 3; k++) codes.shape[k] = shapes.narrow[3 * n + k];
        for (u32 axis = 0; axis < 2; axis++) codes.place[axis] = places.narrow[2 * n + axis];
        states[n] = intra_state(&codes, D);
    }
    write_narrow("state", 8, states, cells.rows);
}

static void main_inter(void) {
    u64 count;
    const struct splat *before = read_states(&count);
    const i32 *motion = read_input("motion").narrow, *differences = read_input("differences").narrow;
    struct splat *states = take(&memory, count, sizeof *states);
    i32 D = step_of(read_size("quantizer"));
    for (u64 n = 0; n < count; n++) states[n] = inter_state(&before[n], motion + 2 * n, differences + 8 * n, D);
    write_narrow("state", 8, states, count);
}

static void state_parameters(void) {
    u64 count;
    const struct splat *states = read_states(&count);
    float (*parameters)[8] = take(&memory, count, sizeof *parameters);
    for (u64 n = 0; n < count; n++) parameters_of(&states[n], parameters[n]);
    write_array("parameters", "<f4", 8, parameters, count);
}

static void main_work(void) {
    u64 count;
    const struct splat *states = read_states(&count);
    u32 width = read_size("width"), height = read_size("height"), halvings = read_size("halvings");
    write_number("work.npy", (i64)work_of(states, (u32)count, width, height, halvings));
}

static const struct { const char *name; void (*run)(void); } operations[] = {
    {"reconstruct_stream", reconstruct_stream}, {"reconstruct_layers", reconstruct_layers},
    {"read_main_stream", read_main_stream}, {"encode_run", encode_run}, {"density_frequencies", density_frequencies},
    {"window_frequencies", window_frequencies}, {"half_frequencies", half_frequencies},
    {"codes_of_classes", codes_of_classes}, {"cells_of_halves", find_cells}, {"field_vectors", field_vectors},
    {"model_frequencies", frequencies_of_models}, {"adapt_model", counts_of_models}, {"mode_contexts", mode_contexts},
    {"motion_of_splats", motion_of_splats}, {"splat_classes", splat_classes}, {"main_intra", main_intra},
    {"main_inter", main_inter}, {"state_parameters", state_parameters}, {"main_work", main_work},
};

static bool answer(const char *name) {              /* whether it is supported */
    bool found = false;
    for (size_t n = 0; n < sizeof operations / sizeof *operations && !found; n++) {
        found = !strcmp(name, operations[n].name);
        if (found) operations[n].run();
    }
    free_all(&memory);
    return found;
}

static int serve(void) {
    char line[4097], operation[64];
    long long id;
    const char *form = "{\"id\": %lld, \"operation\": \"%63[^\"]\", \"in\": \"%4095[^\"]\", \"out\": \"%4095[^\"]\"";
    const char *environment = "{\"compiler\": \"" __VERSION__ "\", \"command\": \"" FLAGS "\"}";
    printf("{\"gsvc\": 1, \"name\": \"c\", \"environment\": %s}\n", environment);
    fflush(stdout);
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, form, &id, operation, in_dir, out_dir) != 4) return 1;
        printf("{\"id\": %lld, \"status\": \"%s\"}\n", id, answer(operation) ? "done" : "unsupported");
        fflush(stdout);
    }
    return 0;
}

int main(int count, char **words) {
    make_tables();
    if (count == 2 && !strcmp(words[1], "--serve")) return serve();
    if (count != 4) return 2;
    snprintf(in_dir, sizeof in_dir, "%s", words[2]);
    snprintf(out_dir, sizeof out_dir, "%s", words[3]);
    return answer(words[1]) ? 0 : 77;
}

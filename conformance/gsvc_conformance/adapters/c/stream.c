/* Streams: chunks, the sequence header, frames with their layers, limits, and the fault that ends a stream. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "decoder.h"

enum { MAIN = 1, VERSION_MAJOR = 130, LONGEST_HEADER = 1024, I_FRAME_SECONDS = 4 };

/* Memory. */

struct piece { struct piece *before; u64 filling; };

void *take(struct arena *arena, u64 count, size_t size) {
    struct piece *piece = calloc(1, sizeof *piece + (size_t)count * size);
    if (!piece) {
        fprintf(stderr, "no memory for %llu things of %zu bytes\n", (unsigned long long)count, size);
        exit(1);
    }
    piece->before = arena->last;
    arena->last = piece;
    return piece + 1;
}

void free_all(struct arena *arena) {
    while (arena->last) {
        struct piece *before = arena->last->before;
        free(arena->last);
        arena->last = before;
    }
}

/* Faults. */

_Noreturn void fault(struct decoder *decoder, const char *rule, u64 bit) {
    decoder->rule = rule;
    decoder->bit = bit;
    longjmp(decoder->on_fault, 1);
}

const char *kind_of(const char *rule) {             /* 12.1 */
    static const char *const kinds[3][12] = {
        {"R-3.1-1", "R-3.1-3", "R-6.1-1", "R-6.2-1", "R-6.2-2", "R-6.2-3", "R-6.2-4", "R-6.6-6", "R-7-1", "R-15.6-5"},
        {"R-3.2-1", "R-5-6", "R-6.1-2", "R-6.5-1", "R-6.6-1"},
        {"R-5-1", "R-5-2", "R-5-3", "R-5-4", "R-5-7", "R-5-8", "R-5-9", "R-5-11", "R-9.4-2"}};
    static const char *const names[3] = {"malformed", "unsupported", "limit"};
    for (u32 kind = 0; kind < 3; kind++) {
        for (u32 k = 0; k < 12 && kinds[kind][k]; k++) if (!strcmp(rule, kinds[kind][k])) return names[kind];
    }
    return "invalid";
}

/* Descriptors (3.1). */

u64 position(const struct bits *bits) { return bits->first_bit + bits->at; }

static void need_from(struct bits *bits, u64 count, u64 element) {
    bits->element = element;
    if (count > 8 * bits->size - bits->at) fault(bits->decoder, bits->end_rule, element);
}

void need(struct bits *bits, u64 count) { need_from(bits, count, position(bits)); }

u32 read_u(struct bits *bits, u32 count) {
    u32 value = 0;
    need(bits, count);
    for (u64 end = bits->at + count; bits->at < end; bits->at++) {
        value = value << 1 | (bits->data[bits->at / 8] >> (7 - bits->at % 8) & 1);
    }
    return value;
}

u32 read_le(struct bits *bits, u32 bytes) {
    u32 value = 0;
    need(bits, 8 * (u64)bytes);
    for (u32 k = 0; k < bytes; k++, bits->at += 8) value |= (u32)bits->data[bits->at / 8] << 8 * k;
    return value;
}

u32 read_uv(struct bits *bits) {
    u64 start = position(bits), value = 0;
    u32 byte = 0x80, group = 0;
    for (; group < 5 && byte >= 0x80; group++) {
        need_from(bits, 8, start);
        byte = read_le(bits, 1);
        value |= (u64)(byte & 0x7F) << 7 * group;
    }
    bits->element = start;
    if (byte >= 0x80 || value >> 32 || (byte == 0 && group > 1)) fault(bits->decoder, "R-3.1-1", start);
    return (u32)value;
}

static void check_filled(struct bits *bits) {
    if (bits->at < 8 * bits->size) fault(bits->decoder, "R-6.2-3", position(bits));
}

/* Chunks (6.2). */

struct chunk { char type; u64 bit, length_bit, size; struct bits payload; };

static struct chunk read_chunk(struct bits *s, u64 longest) {
    struct decoder *d = s->decoder;
    u64 first = s->at / 8;
    struct chunk chunk = {.bit = position(s)};
    u32 type = read_le(s, 1);
    if (!((type >= 'A' && type <= 'Z') || (type >= 'a' && type <= 'z'))) fault(d, "R-6.2-1", s->element);
    chunk.type = (char)type;
    u32 length = read_uv(s);
    chunk.length_bit = s->element;
    if (length > (type == 'H' ? LONGEST_HEADER : longest)) fault(d, "R-5-3", s->element);
    if (d->has_point && strchr("IPR", chunk.type) && length > d->point_limits.payload) fault(d, "R-5-9", s->element);
    need(s, 8 * (u64)length);
    struct bits payload = {d, s->data + s->at / 8, length, 0, position(s), 0, "R-6.2-3"};
    chunk.payload = payload;
    s->at += 8 * (u64)length;
    u32 checksum = crc32c(0, s->data + first, s->at / 8 - first);
    if (read_le(s, 4) != checksum) fault(d, "R-6.2-2", s->element);
    chunk.size = s->at / 8 - first;
    if (type <= 'Z' && !strchr("HIPRE", chunk.type)) fault(d, "R-3.2-1", chunk.bit);
    return chunk;
}

/* The sequence header (6.3, 15.2). */

static struct limits limits_of(u32 level) {         /* section 5 */
    u32 more = level - 1;
    struct limits limits = {
        level == 1 ? 1u << 17 : 1u << (18 + 2 * more), 1u << (14 + 2 * more),
        level == 1 ? 1u << 25 : 1ull << (26 + 2 * more), 1u << (20 + 2 * more)};
    return limits;
}

static u32 element(struct bits *p, struct header *h, u32 bytes, u32 low, u32 high, const char *rule) {
    u32 value = read_le(p, bytes);
    if (value < low || value > high) fault(p->decoder, rule, p->element);
    return h->elements[h->element_count++] = value;
}

static void read_qualities(struct bits *p, struct header *h) {
    u64 bits[4], wrong = 0;
    u32 greatest = 0, count = h->layer_count;
    bool fits = true;
    for (u32 q = 0; q < count; q++) {
        u32 level = read_u(p, 3);
        bits[q] = p->element;
        if (level < 1 || level > 5) fault(p->decoder, "R-3.2-1", p->element);
        h->quality_level[q] = h->elements[h->element_count++] = level;
        u32 halvings = h->quality_halvings[q] = h->elements[h->element_count++] = read_u(p, 2);
        if (read_u(p, 3)) fault(p->decoder, "R-3.2-1", p->element);
        if (level > greatest) greatest = level;
        u64 pixels = (u64)halved(h->width, halvings) * halved(h->height, halvings);
        if (fits && pixels > limits_of(level).pixels) fits = false, wrong = bits[q];
    }
    if (!fits) fault(p->decoder, "R-5-9", wrong);
    if (greatest != h->level) fault(p->decoder, "R-5-9", bits[count - 1]);
}

static void read_header(struct bits *p, struct header *h) {
    static const u32 most_lane_exponents[6] = {0, 6, 8, 10, 12, 12};
    h->profile = element(p, h, 1, 0, 1, "R-3.2-1");
    if (h->profile != MAIN) fault(p->decoder, "R-5-6", p->element);
    h->level = element(p, h, 1, 1, 5, "R-3.2-1");
    h->flags = element(p, h, 1, 0, 3, "R-3.2-1");
    h->width = element(p, h, 2, 1, 65535, "R-6.3-1");
    h->height = element(p, h, 2, 1, 65535, "R-6.3-1");
    if ((u64)h->width * h->height > limits_of(h->level).pixels) fault(p->decoder, "R-5-1", p->element);
    h->frame_rate_numerator = element(p, h, 4, 1, UINT32_MAX, "R-6.3-1");
    h->frame_rate_denominator = element(p, h, 4, 1, UINT32_MAX, "R-6.3-1");
    element(p, h, 2, 0, 65535, ""), element(p, h, 2, 0, 65535, ""); /* sample_aspect_numerator, _denominator */
    h->frame_count = element(p, h, 4, 0, UINT32_MAX, "");
    element(p, h, 1, 8, 16, "R-6.3-1");             /* bit_depth */
    for (u32 k = 0; k < 6; k++) element(p, h, 1, 0, 255, ""); /* chroma_format to chroma_sample_loc_type */
    h->max_lane_exponent = element(p, h, 1, 0, 12, "R-6.3-1");
    if (h->max_lane_exponent > most_lane_exponents[h->level]) fault(p->decoder, "R-5-11", p->element);
    h->layer_count = element(p, h, 1, 1, 4, "R-3.2-1");
    element(p, h, 1, 0, 0, "R-3.2-1");              /* main_tools */
    if (h->layer_count > 1) read_qualities(p, h);
}

static void set_point(struct decoder *d) {          /* what the quality promises beside `level` */
    const struct header *h = &d->header;
    u32 q = d->quality < h->layer_count ? d->quality : h->layer_count - 1;
    d->limits = limits_of(h->level);
    d->halvings = h->quality_halvings[q];
    d->has_point = h->layer_count > 1 && (h->quality_level[q] != h->level || d->halvings);
    if (d->has_point) d->point_limits = limits_of(h->quality_level[q]);
}

/* Limits (5): each against `level`, then against the operating point. */

void check_splats(struct decoder *d, u64 count, u64 bit) {
    if (count > d->limits.splats) fault(d, "R-5-2", bit);
    if (d->has_point && count > d->point_limits.splats) fault(d, "R-5-9", bit);
}

struct amounts { u64 splats, work, point_work; };   /* of the layers that are there */

static struct amounts amounts_of(const struct decoder *d) {
    struct amounts sum = {0, 0, 0};
    for (u32 l = 0; l < 4; l++) {
        const struct carried *layer = &d->layers[l];
        if (layer->there) sum.splats += layer->count, sum.work += layer->work, sum.point_work += layer->point_work;
    }
    return sum;
}

static void find_work(const struct decoder *d, struct carried *layer) {
    const struct header *h = &d->header;
    layer->work = layer->point_work = work_of(layer->splats, layer->count, h->width, h->height, 0);
    if (d->halvings) layer->point_work = work_of(layer->splats, layer->count, h->width, h->height, d->halvings);
}

static void check_work(struct decoder *d, u64 bit) {
    struct amounts sum = amounts_of(d);
    if (sum.work > d->limits.work) fault(d, "R-5-4", bit);
    if (d->has_point && sum.point_work > d->point_limits.work) fault(d, "R-5-9", bit);
}

static u64 frames_of_second(const struct header *h) { /* k */
    return ((u64)h->frame_rate_numerator + h->frame_rate_denominator - 1) / h->frame_rate_denominator;
}

static void check_sums(struct decoder *d, const struct second *sums, const struct limits *limits, const char *rule,
                       u64 bit) {
    if (sums->pixels > 64 * limits->pixels || sums->splats > 64 * limits->splats || sums->work > 8 * limits->work ||
        sums->bytes > limits->payload) fault(d, rule, bit);
}

static void check_second(struct decoder *d, struct amounts before, u64 bit) { /* R-5-7, with what is new */
    struct amounts now = amounts_of(d);
    d->second.splats += now.splats - before.splats, d->point_second.splats += now.splats - before.splats;
    d->second.work += now.work - before.work, d->point_second.work += now.point_work - before.point_work;
    d->second.bytes += d->waiting, d->point_second.bytes += d->waiting;
    d->waiting = 0;
    check_sums(d, &d->second, &d->limits, "R-5-7", bit);
    if (d->has_point) check_sums(d, &d->point_second, &d->point_limits, "R-5-9", bit);
}

static void begin_second(struct decoder *d, u64 bit) { /* of a base that is sound, with carried layers */
    static const struct second empty;
    static const struct amounts nothing;
    const struct header *h = &d->header;
    u64 k = frames_of_second(h);
    if (d->frame_number % k == 0) d->second = d->point_second = empty;
    d->second.pixels += (u64)h->width * h->height;
    d->point_second.pixels += (u64)halved(h->width, d->halvings) * halved(h->height, d->halvings);
    check_second(d, nothing, bit);
    if (d->frame_type == 'I') d->last_i_frame = d->frame_number;
    if (d->frame_number - d->last_i_frame >= I_FRAME_SECONDS * k) fault(d, "R-5-8", bit);
}

static bool paced(const struct decoder *d) { return d->header.flags >> 1 & 1; }

/* Frames (6.4, 15.5). */

static void end_frame(struct decoder *d) {          /* with the layers that it has */
    if (d->open && d->on_frame) d->on_frame(d->reader, d);
    d->open = false;
}

static void carry(struct decoder *d, struct carried *layer) { /* by the field of the base (15.13) */
    static const i32 nothing[8];
    i32 D = step_of(layer->quantizer), motion[2];
    for (u32 n = 0; n < layer->count; n++) {
        motion_of(&layer->splats[n], &d->base_field, motion);
        layer->splats[n] = inter_state(&layer->splats[n], motion, nothing, D);
        layer->past[n] = 0;
    }
    find_work(d, layer);
}

static void begin_layers(struct decoder *d) {       /* which of them are there with this base */
    for (u32 l = 1; l <= d->quality && l < d->header.layer_count; l++) {
        struct carried *layer = &d->layers[l];
        layer->known = layer->there && d->frame_type != 'I';
        layer->there = layer->known && !(d->mask >> l & 1);
        if (layer->there && d->frame_type == 'P') carry(d, layer);
    }
}

static void read_frame(struct decoder *d, struct chunk *chunk) {
    struct bits *p = &chunk->payload;
    struct carried *base = &d->layers[0];
    u32 stated = 0;
    u64 checksum_bit = 0;
    d->frame_type = chunk->type;
    d->frame_number = read_uv(p);
    if (d->frame_number != d->next_number) fault(d, "R-6.4-1", p->element);
    if (d->header.flags & 1) stated = read_le(p, 4), checksum_bit = p->element;
    d->mask = d->last_layer = 0;
    if (d->header.layer_count > 1) {
        d->mask = read_le(p, 1);
        if (d->mask & 0xF1) fault(d, "R-3.2-1", p->element);
        d->mask &= (1u << d->header.layer_count) - 1;
    }
    free_all(&d->base_memory);
    memset(&d->base_field, 0, sizeof d->base_field);
    if (chunk->type != 'R') {
        read_body(d, p, chunk->type, 0, 0);
        find_work(d, base);
    }
    check_filled(p);
    base->there = true;
    begin_layers(d);
    check_splats(d, amounts_of(d).splats, chunk->bit);
    check_work(d, chunk->bit);
    if (d->header.flags & 1 && stated != checksum_of(base->splats, base->count)) fault(d, "R-6.4-3", checksum_bit);
    if (paced(d)) begin_second(d, chunk->bit);
    d->next_number++;
    d->open = true;
}

/* Layers (15.13). */

static void check_missing(struct decoder *d, u32 below, u64 bit) { /* R-15.13-6: those that are wanted and named */
    for (u32 l = 1; d->open && l < below && l <= d->quality; l++) {
        if (d->mask >> l & 1 && l > d->last_layer) fault(d, "R-15.13-6", bit);
    }
}

static void read_wanted(struct decoder *d, struct chunk *chunk, u32 number) {
    struct bits *p = &chunk->payload;
    struct carried *layer = &d->layers[number];
    u64 others = amounts_of(d).splats, checksum_bit = 0;
    u32 stated = 0;
    if (d->has_point && p->size > d->point_limits.payload) fault(d, "R-5-9", chunk->length_bit);
    u32 type = read_u(p, 2);
    u64 type_bit = p->element;
    if (type == 3) fault(d, "R-3.2-1", type_bit);
    if (type != 0 && !layer->known) fault(d, "R-15.13-2", type_bit);
    if (read_u(p, 4) != d->frame_number % 16) fault(d, "R-15.13-4", p->element);
    if (type == 2) check_splats(d, others + layer->count, type_bit);
    if (d->header.flags & 1) stated = read_le(p, 4), checksum_bit = p->element;
    free_all(&d->layer_memory);
    if (type != 2) {
        read_body(d, p, "IP"[type], number, others);
        find_work(d, layer);
    }
    check_filled(p);
    layer->there = true;
    check_work(d, chunk->bit);
    if (d->header.flags & 1 && stated != checksum_of(layer->splats, layer->count)) fault(d, "R-6.4-3", checksum_bit);
}

static void read_layer(struct decoder *d, struct chunk *chunk) { /* a chunk `n` after a frame */
    struct amounts before = amounts_of(d);
    if (d->quality > 0) {
        u32 number = read_u(&chunk->payload, 2);
        if (number == 0) fault(d, "R-3.2-1", chunk->payload.element);
        if (number <= d->last_layer || !(d->mask >> number & 1)) fault(d, "R-15.13-1", chunk->payload.element);
        check_missing(d, number, chunk->bit);
        d->last_layer = d->layer_at_work = number;
        if (number <= d->quality) read_wanted(d, chunk, number);
    }
    if (paced(d)) check_second(d, before, chunk->bit);
    d->layer_at_work = 0;
}

/* Whole streams (6.1, 6.7, 6.8, 12.2). */

static void read_index(struct decoder *d, struct chunk *chunk) {
    struct bits *p = &chunk->payload;
    u32 count = read_uv(p);
    u64 first_bit = position(p), offset = 0;
    for (u32 entry = 0; entry < count; entry++) {
        u32 number_step = read_uv(p), offset_step = read_uv(p);
        offset += offset_step;
        if ((entry && !(number_step && offset_step)) || offset >= chunk->bit / 8) fault(d, "R-6.7-1", first_bit);
    }
    check_filled(p);
}

static void read_end(struct decoder *d, struct chunk *chunk) {
    struct bits *p = &chunk->payload;
    u32 frame_count = read_le(p, 4);
    u64 count_bit = p->element;
    u32 index_length = read_le(p, 4);
    if (frame_count != d->next_number) fault(d, "R-6.8-1", count_bit);
    if (d->header.frame_count && d->header.frame_count != frame_count) fault(d, "R-6.3-2", count_bit);
    if (index_length != d->index_length) fault(d, "R-6.8-2", p->element);
    check_filled(p);
}

static void read_prefix(struct bits *s) {
    static const u8 magic[8] = {0x89, 0x47, 0x53, 0x56, 0x43, 0x0D, 0x0A, 0x1A};
    struct decoder *d = s->decoder;
    need(s, 64);
    if (memcmp(s->data, magic, 8)) fault(d, "R-6.1-1", s->element);
    s->at = 64;
    s->end_rule = "R-6.2-4";
    if (read_le(s, 1) != VERSION_MAJOR) fault(d, "R-6.1-2", s->element);
    u32 version_minor = read_le(s, 1);
    struct chunk chunk = read_chunk(s, LONGEST_HEADER);
    if (chunk.type != 'H') fault(d, "R-6.1-3", chunk.bit);
    read_header(&chunk.payload, &d->header);
    if (version_minor == 0) check_filled(&chunk.payload);
    set_point(d);
}

static void read_chunks(struct decoder *d, struct bits *s) {
    for (char type = 'H'; type != 'E';) {
        struct chunk chunk = read_chunk(s, d->limits.payload);
        type = chunk.type;
        if (type == 'H') fault(d, "R-6.1-3", chunk.bit);
        if (d->next_number == 0 && type == 'E') fault(d, "R-6.1-5", chunk.bit);
        if (d->next_number == 0 && (type == 'P' || type == 'R')) fault(d, "R-6.4-2", chunk.bit);
        bool of_frame = type == 'n' && d->next_number > 0 && (d->header.layer_count > 1 || d->quality > 0);
        d->waiting += chunk.size;
        if (type <= 'Z') {
            check_missing(d, 4, chunk.bit);
            end_frame(d);
        }
        if (type == 'E') read_end(d, &chunk);
        d->index_length = 0;
        if (type == 'x') {
            read_index(d, &chunk);
            d->index_length = (u32)chunk.size;
        }
        if (of_frame) read_layer(d, &chunk);
        if (type == 'I' || type == 'P' || type == 'R') read_frame(d, &chunk);
    }
    if (s->at < 8 * s->size) fault(d, "R-6.1-4", position(s));
}

void decode(struct decoder *decoder, const u8 *stream, u64 size) {
    struct bits *s = take(&decoder->stream_memory, 1, sizeof *s); /* not on the stack, which longjmp forgets */
    s->decoder = decoder, s->data = stream, s->size = size, s->end_rule = "R-6.1-1";
    if (!setjmp(decoder->on_fault)) {
        read_prefix(s);
        read_chunks(decoder, s);
    } else if (decoder->layer_at_work) {
        decoder->layers[decoder->layer_at_work].there = false;
    }
    end_frame(decoder);
    for (u32 l = 0; l < 4; l++) free(decoder->layers[l].splats), free(decoder->layers[l].past);
    free_all(&decoder->base_memory), free_all(&decoder->layer_memory), free_all(&decoder->stream_memory);
}

/* Two operations behind the protocols of GSVC's conformance kit (protocol.md), for little-endian machines:
   cc -O2 -o minimal minimal.c -lm && gsvc-conformance run --impl ./minimal --operation from_half
   or, as one process that answers all vectors:     gsvc-conformance run --serve "./minimal --serve" ... */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char in_dir[4096], out_dir[4096];
static void *taken[8];                              /* memory for one vector: in each operation at most 8 pieces */
static int taken_count;
struct array { char shape[64]; size_t bytes; void *data; };

static void *take(size_t bytes) {
    void *memory = malloc(bytes + 1);
    if (!memory) { perror("malloc"); exit(1); }
    return taken[taken_count++] = memory;
}

static FILE *open_npy(const char *folder, const char *name, const char *mode) {
    char path[4200];
    snprintf(path, sizeof path, "%s/%s.npy", folder, name);
    FILE *file = fopen(path, mode);
    if (!file) { perror(path); exit(1); }
    return file;
}

static struct array read_npy(const char *name) {    /* the operation says what the type is */
    FILE *file = open_npy(in_dir, name, "rb");
    unsigned char start[10];                        /* magic, version 1.0, length of the header */
    char header[65536] = "";
    if (fread(start, 1, 10, file) != 10 || fread(header, 1, start[8] + 256u * start[9], file) < 1) exit(1);
    long first = ftell(file), end = (fseek(file, 0, SEEK_END), ftell(file));
    struct array array = {"", (size_t)(end - first), take((size_t)(end - first))};
    sscanf(strstr(header, "'shape': ("), "'shape': (%63[^)]", array.shape);
    fseek(file, first, SEEK_SET);
    if (fread(array.data, 1, array.bytes, file) != array.bytes) exit(1);
    fclose(file);
    return array;
}

static int64_t read_int(const char *name) { return *(int64_t *)read_npy(name).data; }

static void write_npy(const char *name, const char *type, const char *shape, const void *data, size_t bytes) {
    FILE *file = open_npy(out_dir, name, "wb");
    char text[118];                                 /* 10 + 118 bytes: the data begins at a multiple of 64 */
    snprintf(text, sizeof text, "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }", type, shape);
    fprintf(file, "\x93NUMPY%c%c%c%c%-117s\n", 1, 0, 118, 0, text);
    fwrite(data, 1, bytes, file);
    if (fclose(file)) exit(1);
}

static void from_half(void) {
    struct array bits = read_npy("bits");
    size_t count = bits.bytes / 2;
    float *values = (float *)take(4 * count);
    for (size_t i = 0; i < count; i++) {
        int half = ((uint16_t *)bits.data)[i], exponent = half >> 10 & 31, fraction = half & 1023;
        double size = exponent == 31 ? INFINITY : exponent ? ldexp(1024 + fraction, exponent - 25) : ldexp(fraction, -24);
        values[i] = (float)copysign(size, half & 0x8000 ? -1 : 1);
    }
    write_npy("values", "<f4", bits.shape, values, 4 * count);
}

static void render_sum(void) {                      /* (9-1) and (9-2) */
    struct array parameters = read_npy("parameters");
    int64_t width = read_int("width"), height = read_int("height");
    size_t bytes = 12 * (size_t)(width * height), count = parameters.bytes / 32;
    float *sum = (float *)take(bytes);
    for (int64_t pixel = 0; pixel < width * height; pixel++) {
        double color[3] = {0, 0, 0};
        for (size_t n = 0; n < count; n++) {
            const float *p = (float *)parameters.data + 8 * n;      /* x, y, l11, l21, l22, R, G, B */
            if (!(p[2] >= FLT_MIN && p[4] >= FLT_MIN && isfinite(p[2]) && isfinite(p[4]))) continue;
            double u1 = (pixel % width + 0.5 - p[0]) / p[2], u2 = (pixel / width + 0.5 - p[1] - p[3] * u1) / p[4];
            double sigma = (u1 * u1 + u2 * u2) / 2;
            if (sigma <= log(255)) for (int c = 0; c < 3; c++) color[c] += p[5 + c] * exp(-sigma);
        }
        for (int c = 0; c < 3; c++) sum[3 * pixel + c] = (float)color[c];
    }
    char shape[64];
    snprintf(shape, sizeof shape, "%lld, %lld, 3", (long long)height, (long long)width);
    write_npy("sum", "<f4", shape, sum, bytes);
}

static int answer(const char *operation) {
    int supported = 1;
    if (!strcmp(operation, "from_half")) from_half();
    else if (!strcmp(operation, "render_sum")) render_sum();
    else supported = 0;
    while (taken_count) free(taken[--taken_count]);
    return supported;
}

static int serve(void) {
    char line[4097], operation[64];                 /* no request is longer than 4096 bytes, with its end of line */
    long long id;
    const char *form = "{\"id\": %lld, \"operation\": \"%63[^\"]\", \"in\": \"%4095[^\"]\", \"out\": \"%4095[^\"]\"";
    puts("{\"gsvc\": 1, \"name\": \"minimal.c\"}");
    fflush(stdout);
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, form, &id, operation, in_dir, out_dir) != 4) return 1;
        printf("{\"id\": %lld, \"status\": \"%s\"}\n", id, answer(operation) ? "done" : "unsupported");
        fflush(stdout);
    }
    return 0;
}

int main(int count, char **words) {
    if (count == 2 && !strcmp(words[1], "--serve")) return serve();
    if (count != 4) return 2;
    snprintf(in_dir, sizeof in_dir, "%s", words[2]);
    snprintf(out_dir, sizeof out_dir, "%s", words[3]);
    return answer(words[1]) ? 0 : 77;               /* 77: not supported */
}

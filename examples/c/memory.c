/* RAM and flash by model size, as the table of docs/reference/c-api.md. */
#include <eitskin/eitskin.h>
#include <stdio.h>

typedef struct size {
    const char *name;
    uint32_t electrodes, rows, folded, rank, pixels_across, pixels;
} size;

static const size SIZES[] = {
    {"16 electrodes, coarse", 16, 208, 104, 32, 20, 316},
    {"16 electrodes, the prebuilt model", 16, 208, 104, 64, 32, 812},
    {"16 electrodes, full rank", 16, 208, 104, 104, 32, 812},
    {"16 electrodes, fine", 16, 208, 104, 104, 40, 1264},
    {"32 electrodes", 32, 928, 464, 128, 32, 812},
};

/* Bytes of an .eitm without its JSON and padding: matrices, fields, table, grid, golden frame. */
static size_t model_bytes(const size *s, size_t bytes_a_number)
{
    const size_t stride = EITS_STRIDE(s->rank);
    const size_t matrices = 4 * stride * s->folded + bytes_a_number * stride * s->pixels;
    const size_t fields = (size_t)2 * (2 * s->electrodes + 4) * s->pixels;
    const size_t rest = 4u * s->rows + 12u * s->folded + 8u * s->pixels;
    return matrices + fields + rest + 8u * s->rows + 4u * s->pixels;
}

int main(void)
{
    printf("| model | rank x pixels | RAM, kB | RAM, host, kB | flash f32, kB | flash i8, kB |\n");
    printf("|-|-|-|-|-|-|\n");
    for (size_t k = 0; k < sizeof SIZES / sizeof *SIZES; ++k) {
        const size *s = &SIZES[k];
        const size_t cells = (size_t)s->pixels_across * s->pixels_across;
        const size_t ram =
            EITS_WORKSPACE_SIZE(s->rows, s->folded, s->rank, s->pixels, cells, s->electrodes, 0);
        const size_t host =
            EITS_WORKSPACE_SIZE(s->rows, s->folded, s->rank, s->pixels, cells, s->electrodes, 1);
        printf("| %s | %u x %u | %zu | %zu | %zu | %zu |\n", s->name, (unsigned)s->rank,
               (unsigned)s->pixels, ram / 1000, host / 1000, model_bytes(s, 4) / 1000,
               model_bytes(s, 1) / 1000);
    }
    return 0;
}

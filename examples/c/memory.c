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

/* What `model build` puts into the sections of the model errors, with its defaults. */
enum { PLACES = 16, MOVES = 16, TERMS = EITS_MAX_MOVE_TERMS, RESTS = 16, ROW_ERRORS = 24 };

/* Bytes of an .eitm without its JSON, section by section (docs/reference/eitm-format.md). */
static size_t model_bytes(const size *s, size_t bytes_a_number)
{
    const size_t rows = s->rows, folded = s->folded, rank = s->rank, pixels = s->pixels;
    const size_t stride = EITS_STRIDE(rank), fields = EITS_STRIDE(2 * s->electrodes + 4);
    const size_t sections[] = {
        64 + 16 * 18,                                                 /* head and table */
        64,                                                           /* DIMS */
        64,                                                           /* DEFS */
        4 * rows,                                                     /* PROT */
        8 * folded,                                                   /* FOLD */
        4 * folded,                                                   /* VREF */
        4 * stride * folded,                                          /* REDU */
        bytes_a_number * stride * pixels,                             /* SENS */
        bytes_a_number < 4 ? 4 * pixels : 0,                          /* SCAL */
        4 * pixels,                                                   /* COLW */
        4 * pixels,                                                   /* GRID */
        4 * (2 * rows + pixels),                                      /* GOLD */
        36,                                                           /* SUMS */
        16 + 16 * stride,                                             /* WHIT */
        16 + 4 * rank * (rank + 1),                                   /* UNCE */
        4 * PLACES * folded,                                          /* GEOM */
        16 + 4 * (MOVES * (folded + 2 * TERMS) + RESTS * folded),     /* MOVE */
        16 + 4 * (folded * (ROW_ERRORS + MOVES) + 4 * TERMS * MOVES), /* ROWE */
        16 + 2 * fields * pixels,                                     /* FLDS */
    };
    size_t bytes = 0;
    for (size_t k = 0; k < sizeof sections / sizeof *sections; ++k)
        bytes += EITS_ALIGN16(sections[k]);
    return bytes;
}

static size_t kb(size_t bytes)
{
    return (bytes + 500) / 1000;
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
               (unsigned)s->pixels, kb(ram), kb(host), kb(model_bytes(s, 4)),
               kb(model_bytes(s, 1)));
    }
    return 0;
}

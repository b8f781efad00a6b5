/* Writes the first inputs of a fuzz target into a folder: seeds TARGET FOLDER. scripts/fuzz begins
 * with these and the kept corpus. */
#include "fuzz.h"

#include "small_model.h"

static const char *folder;

static void keep(const char *name, unsigned number, const uint8_t *bytes, size_t size)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s-%02u", folder, name, number);
    FILE *file = fopen(path, "wb");
    if (file == NULL || fwrite(bytes, 1, size, file) != size || fclose(file) != 0) {
        fprintf(stderr, "cannot write %s\n", path);
        exit(1);
    }
}

/* With a section LOAD, order by order. */
static void calibrated(unsigned k, const small_model *bare)
{
    enum { HEAD = 32, POINTS = 4 };
    const uint32_t order = k % 5, terms = (order + 1) * (order + 2) / 2;
    uint8_t load[HEAD + 8 * POINTS + 4 * 15] = {0};
    small_put_u32(load, POINTS);
    small_put_u32(load + 4, order);
    small_put_f32(load + 8, 5.0f);
    small_put_f32(load + 12, 0.9f);
    for (uint32_t i = 0; i < POINTS; ++i) {
        small_put_f32(load + HEAD + 4 * i, (float)i);
        small_put_f32(load + HEAD + 4 * (POINTS + i), (float)(i * i));
    }
    for (uint32_t i = 0; i < terms; ++i)
        small_put_f32(load + HEAD + 4 * (2 * POINTS + i), i == 0 ? 1.0f : 0.1f);
    small_model made =
        small_model_with_section(bare, "LOAD", load, HEAD + 4 * (2 * POINTS + terms));
    keep("load", k, made.blob, made.size);
    small_model_free(&made);
}

static void models(void)
{
    for (unsigned k = 0; k < 24; ++k) {
        const small_spec spec = {.rank = 1 + k % 9,
                                 .side = 1 + k % 5,
                                 .storage = (eits_storage)(k % 4),
                                 .kind = (eits_data_kind)(k % 3),
                                 .shape = k % 5 == 0 ? SMALL_WAVES : SMALL_RANDOM,
                                 .lipschitz_factor = k == 23 ? 0.1 : 0,
                                 .fields = k % 6 == 0};
        if (spec.shape == SMALL_WAVES && spec.side * spec.side < spec.rank)
            continue;
        small_model made = small_model_make(spec);
        small_put_u32(small_model_section(&made, "DEFS", NULL), 1 + k); /* iterations */
        small_put_u32(small_model_section(&made, "DEFS", NULL) + 56,
                      k % 3 < 2 ? k % 3 : EITS_SOLVER_ACTIVE_SET);
        small_model_seal(&made);
        keep("small", k, made.blob, made.size);
        if (k % 4 < 2)
            calibrated(k, &made);
        if (k % 8 == 0)
            keep("cut", k, made.blob, made.size / 2);
        small_model_free(&made);
    }
}

static void packets(void)
{
    static const uint16_t sizes[] = {0, 1, 4, 8, 16, 36, 68, 152, 241, 242, 243, 495, 500};
    for (unsigned k = 0; k < sizeof sizes / sizeof sizes[0]; ++k) {
        uint8_t payload[512], wire[2 + 2 * EITS_LINK_ENCODED(512)] = {255, (uint8_t)(37 * k)};
        for (unsigned i = 0; i < sizes[k]; ++i)
            payload[i] = (uint8_t)(k % 3 == 0 ? 0 : k % 3 == 1 ? 0xFF : i * 7);
        size_t at = 2;
        for (uint32_t sequence = 0; sequence < 2; ++sequence)
            at += eits_link_encode(wire + at, sizeof wire - at, (uint8_t)(0x80 + k), sequence,
                                   payload, sizes[k], NULL, 0);
        keep("packets", k, wire, at);
        wire[at / 2] ^= 0x10;
        keep("damaged", k, wire, at - 1);
    }
}

/* fuzz_frame.c reads these steps. */
static void scripts(void)
{
    for (unsigned model = 0; model < 16; ++model) {
        for (unsigned solver = 0; solver < 4; ++solver) { /* 2 is rejected */
            uint8_t script[256] = {(uint8_t)(model | (model + solver) % 4 << 4)};
            size_t at = 1;
            const uint8_t learn[] = {1, 4, 1, 127, 1, 2, 3,   4, 5, 6,   7, 8,  9,
                                     1, 2, 3, 4,   5, 1, 127, 9, 8, 7,   6, 5,  4,
                                     3, 2, 1, 9,   8, 7, 6,   5, 0, 127, 0, 127};
            const uint8_t once[] = {0, 0, 127};
            const uint8_t options[] = {
                3,  2,
                23, (uint8_t)solver,
                22, (uint8_t)(model % 3 + (solver > 1 ? 4 : 0) + (model == 2 ? 8 : 0)),
                4,  (uint8_t)(model % 2)};
            const uint8_t frames[] = {6, 1,  127, 30, 0, 40,  0, 50, 0, 60,   0,    20, 0, 9,
                                      0, 90, 0,   6,  6, 127, 5, 0,  0, 0xC0, 0x7F, 5,  1, 127,
                                      1, 30, 2,   40, 0, 50,  0, 60, 0, 20,   0,    9,  0, 90};
            memcpy(script + at, solver % 2 ? learn : once, solver % 2 ? sizeof learn : sizeof once);
            at += solver % 2 ? sizeof learn : sizeof once;
            memcpy(script + at, options, sizeof options);
            at += sizeof options;
            memcpy(script + at, frames, sizeof frames);
            at += sizeof frames;
            keep("script", model * 4 + solver, script, at);
        }
    }
}

/* fuzz_skin.c reads these: one finger or two, at rest or moving, that lift and come again. */
static void fingers(void)
{
    for (unsigned k = 0; k < 48; ++k) {
        const uint8_t sign = (uint8_t)(k % 3 == 1 ? 0x90 : 0x70);
        const uint8_t script[] = {(uint8_t)(k * 37),
                                  (uint8_t)(k * 91),
                                  (uint8_t)(20 + k),
                                  0,
                                  (uint8_t)(k * 13),
                                  (uint8_t)(k * 29),
                                  80,
                                  sign,
                                  14,
                                  8,
                                  (uint8_t)(200 + k * 7),
                                  (uint8_t)(k * 3),
                                  100,
                                  sign,
                                  (uint8_t)(1 + 8 * (k % 2)),
                                  (uint8_t)(k % 5 * 9),
                                  (uint8_t)(k * 5),
                                  14,
                                  (uint8_t)(k % 4 == 3 ? 0x84 : 2),
                                  3,
                                  6,
                                  5,
                                  (uint8_t)(k % 3),
                                  0,
                                  (uint8_t)(k * 13),
                                  (uint8_t)(k * 29),
                                  80,
                                  sign,
                                  14,
                                  (uint8_t)(k % 4 == 2 ? 3 : 10),
                                  7,
                                  90,
                                  14};
        keep("fingers", k, script, sizeof script);
    }
}

/* Seeds of the board: every command, with usual fields and with an odd one; an upload of every
 * model, also with a loss of power at some write; every fault in a running stream. */
static void boards(void)
{
    for (unsigned k = 0; k < 12 * 14; ++k) { /* 0, 1 and the greatest in every field */
        const uint8_t type = (uint8_t)(1 + k / 14), at = (uint8_t)(4 + 2 * (k % 14));
        const uint8_t field[] = {2, 0, type, 1,  at, 0,    0, 3,  20, 0, type, 1, at,
                                 0, 1, 3,    20, 0,  type, 1, at, 0,  8, 3,    20};
        keep("field", k, field, sizeof field);
    }
    /* locked by its owner, who lets go of the button; then an upload, and too much current */
    const uint8_t locked[] = {3, 6, 11, 1, 0, 14, 0, 6, 11, 0, 5, 1, 1, 0,  14,  1, 4,
                              0, 0, 9,  1, 0, 3,  0, 3, 60, 0, 2, 0, 6, 12, 200, 3, 90};
    keep("locked", 0, locked, sizeof locked);
    /* touches after each drive, of a model that has fields */
    for (unsigned k = 0; k < 4; ++k) {
        const uint8_t followed[] = {
            (uint8_t)k, 5,  4,   1, 3, 10, 0, 3,   0, 0,  2,
            0,          3,  250, 0, 1, 0,  3, 100, 7, 60, (uint8_t)(120 + 8 * k),
            3,          200};
        keep("followed", k, followed, sizeof followed);
    }
    /* 1 kHz in 1000 samples: more current than is safe */
    const uint8_t slow[] = {2, 0,  3, 2,   4,    1, 200, 0x40, 0x42, 0x0F,
                            0, 12, 0, 200, 0xE8, 3, 0,   0,    3,    9};
    keep("slow", 0, slow, sizeof slow);
    for (unsigned k = 0; k < 20; ++k) {
        const uint8_t odd[] = {3, 0, (uint8_t)k, 0,          3, 20, 0, (uint8_t)k, 1, 4,
                               1, 6, 0,          (uint8_t)k, 1, 8,  0, 12,         3, 60};
        keep("command", k, odd, sizeof odd);
        const uint8_t fault[] = {
            (uint8_t)(2 + k % 2), 6, (uint8_t)(k + 48 * (k / 12)), 5, 3, 80, 0, 3, 0, 3, 90};
        keep("fault", k, fault, sizeof fault);
        const uint8_t model = (uint8_t)(k % 6 + 6 * (k / 6));
        const uint8_t upload[] = {(uint8_t)(k % 4),
                                  5,
                                  model,
                                  2,
                                  4,
                                  2,
                                  1,
                                  9,
                                  1,
                                  9,
                                  1,
                                  3,
                                  0,
                                  0,
                                  0,
                                  2,
                                  0,
                                  3,
                                  60,
                                  0,
                                  1,
                                  0,
                                  7,
                                  40,
                                  150,
                                  3,
                                  60};
        keep("upload", k, upload, sizeof upload);
        const uint8_t cut[] = {(uint8_t)(k % 4),
                               6,
                               (uint8_t)(k % 2 ? 47 : 23),
                               (uint8_t)(k * 8),
                               5,
                               (uint8_t)(k % 6),
                               1,
                               3,
                               60,
                               5,
                               1,
                               1,
                               3,
                               20};
        keep("cut", k, cut, sizeof cut);
    }
}

int main(int argc, char **argv)
{
    static const struct {
        const char *target;
        void (*write)(void);
    } all[] = {{"model", models},
               {"link", packets},
               {"frame", scripts},
               {"skin", fingers},
               {"board", boards}};
    folder = argc == 3 ? argv[2] : ".";
    for (size_t k = 0; argc == 3 && k < sizeof all / sizeof all[0]; ++k) {
        if (strcmp(argv[1], all[k].target) == 0)
            return all[k].write(), 0;
    }
    fprintf(stderr, "seeds model|link|frame|skin|board FOLDER\n");
    return 2;
}

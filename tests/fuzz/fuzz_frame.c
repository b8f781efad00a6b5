/* Options, masks, references and frames of any bits, as a short script of steps, into the core on
 * one of a few small models. What fuzz.h says must hold. For a quarter of the inputs two contexts
 * do the same, one with the portable kernels and the least workspace, one with this processor's
 * kernels and panels, and must give the same bits; the others run one context alone. */
#include "fuzz.h"

#include "base/vec.h"
#include "small_model.h"

enum { MODELS = 16, STEPS = 8, MAX_ITERATIONS = 24, MAX_SWEEPS = 2 };

/* ---- models ---- */

static small_model blobs[MODELS];
static eits_model models[MODELS];

static void spoil(small_model *made, uint32_t which)
{
    uint32_t bytes;
    uint8_t *weight = small_model_section(made, "COLW", NULL);
    uint8_t *sens = small_model_section(made, "SENS", &bytes);
    if (which == 12) /* columns that are the same, and one of zeros (4 bytes a number) */
        memcpy(sens + 2 * 32, sens + 3 * 32, 32), memset(sens + 5 * 32, 0, 32);
    if (which == 13) /* a pixel that is never shown, one turned round, one almost nothing */
        small_put_f32(weight, 0.0f), small_put_f32(weight + 4, -0.02f),
            small_put_f32(weight + 8, 1e-40f);
    if (which == 14) /* volts that are almost nothing */
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
            small_put_f32(small_model_section(made, "VREF", NULL) + 4 * k, 1e-30f * (float)(k + 1));
    small_model_seal(made);
}

/* Adds the precision matrix of the rows, as a taught model has it: each row depends a little on all
 * others. */
static void add_precision(small_model *made)
{
    enum { PACKED = SMALL_FOLDED * (SMALL_FOLDED + 1) / 2 };
    uint8_t section[4 * PACKED], *at = section;
    uint64_t state = 3;
    for (uint32_t i = 0; i < SMALL_FOLDED; ++i) {
        for (uint32_t j = 0; j <= i; ++j, at += 4)
            small_put_f32(at, i == j ? 2.0f : 0.1f * (float)small_random(&state));
    }
    const small_model bare = *made;
    *made = small_model_with_section(&bare, "PREC", section, sizeof section);
    free(bare.memory);
}

static void make_models(void)
{
    for (uint32_t k = 0; k < MODELS; ++k) {
        small_spec spec = {.rank = 6,
                           .side = 4,
                           .storage = (eits_storage)(k % 4),
                           .kind = (eits_data_kind)(k / 4 % 3)};
        spec.shape = k % 5 == 4 ? SMALL_WAVES : SMALL_RANDOM;
        if (k >= 12) {
            spec.storage = EITS_STORAGE_F32, spec.kind = EITS_DATA_DIFFERENCE,
            spec.shape = SMALL_RANDOM;
            spec.lipschitz_factor = k == 15 ? 0.2 : 0; /* a step five times too long */
        }
        spec.round = k % 3 == 1;
        spec.fields = k % 2 == 0;
        blobs[k] = small_model_make(spec);
        spoil(&blobs[k], k);
        if (k == 0 || k == 8)
            add_precision(&blobs[k]);
        MUST(eits_model_open(&models[k], blobs[k].blob, blobs[k].size) == EITS_OK);
        fuzz_note("models", blobs[k].blob, blobs[k].size);
    }
}

/* ---- one context, and perhaps its twin ---- */

typedef struct twins {
    eits_model model;
    eits_context *ctx[2];
    int count;
    eits_real frame[SMALL_ROWS];
} twins;

static void open_one(twins *t, int k, int portable, int prepared)
{
    const size_t size = eits_workspace_size(&t->model, prepared);
    MUST(size <= FUZZ_WORKSPACE);
    MUST(eits_init(fuzz_workspace(k), size, &t->model, &t->ctx[k]) == EITS_OK);
    MUST(eits_use_portable_kernels(t->ctx[k], portable) == EITS_OK);
}

static void open_twins(twins *t, uint32_t which)
{
    const uint32_t how = which / MODELS % 4;
    t->model = models[which % MODELS];
    t->count = how == 0 ? 2 : 1;
    open_one(t, 0, how < 2, how == 3);
    if (t->count == 2)
        open_one(t, 1, 0, 1);
}

/* The status that a call gives for each context. */
#define BOTH(call) \
    both_gave((call(t->ctx[0])), t->count < 2 ? EITS_OK : (call(t->ctx[1])), t->count)
static eits_status both_gave(eits_status one, eits_status other, int count)
{
    MUST(count < 2 || one == other);
    return one;
}

static int same_bits(const void *a, const void *b, size_t size)
{
    return memcmp(a, b, size) == 0;
}

static void same_results(const twins *t)
{
    const eits_context *a = t->ctx[0], *b = t->ctx[1];
    if (t->count < 2)
        return;
    MUST(same_bits(eits_get_image(a), eits_get_image(b), t->model.n_pixels * sizeof(eits_real)));
    MUST(same_bits(eits_get_coefficients(a), eits_get_coefficients(b),
                   t->model.n_pixels * sizeof(eits_real)));
    MUST(same_bits(eits_get_info(a), eits_get_info(b),
                   offsetof(eits_info, data_norm) + sizeof(eits_real)));
}

/* ---- what the input says ---- */

static void read_frame(twins *t, fuzz_bytes *in)
{
    const uint8_t how = fuzz_u8(in);
    const uint32_t shift = fuzz_u8(in); /* a power of two as the frame's unit */
    const uint32_t bits = (shift > 0 && shift < 255 ? shift : 127u) << 23;
    float unit;
    memcpy(&unit, &bits, sizeof unit);
    switch (how % 4) {
    case 0:
        small_reference(&t->model, (double)unit, t->frame);
        break;
    case 1: /* a reference with changes of some percent */
        small_reference(&t->model, (double)unit, t->frame);
        for (uint32_t i = 0; i < SMALL_ROWS; i += 3)
            t->frame[i] *= 1 + R(0.001) * (eits_real)(int8_t)fuzz_u8(in);
        break;
    case 2:
        break; /* the last frame */
    case 3:
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            t->frame[i] = (eits_real)fuzz_f32(in);
        break;
    }
    for (uint32_t patches = how / 4 % 8; patches > 0; --patches) {
        const uint32_t row = fuzz_u8(in) % SMALL_ROWS;
        t->frame[row] = (eits_real)fuzz_f32(in);
    }
#ifdef EITS_DOUBLE
    if (how >= 224) { /* where only a double goes */
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            t->frame[i] *= how >= 240 ? 1e250 : 1e-250;
    }
#endif
}

static void change_option(eits_options *o, uint8_t which, fuzz_bytes *in)
{
    uint32_t *whole[] = {&o->iterations,  &o->gap_every,         &o->max_touches,  &o->max_masked,
                         &o->warm_start,  &o->project_reference, &o->touch_sweeps, &o->mac_limit,
                         &o->second_pass, &o->touch_seek};
    eits_real *real[] = {&o->lambda_abs,
                         &o->lambda_rel,
                         &o->lambda_noise_factor,
                         &o->detection_factor,
                         &o->gap_rel,
                         &o->saturation_v,
                         &o->touch_threshold,
                         &o->touch_min_fraction,
                         &o->touch_min_radius_mm,
                         &o->touch_max_radius_mm,
                         &o->touch_seed_radius_mm,
                         &o->touch_change_s_per_m,
                         &o->touch_radius_weight,
                         &o->follow_mm,
                         &o->noise_floor_v,
                         &o->regularisation_noise_factor};
    enum { WHOLE = sizeof whole / sizeof whole[0], REAL = sizeof real / sizeof real[0] };
    const uint32_t k = which % (WHOLE + REAL + 2);
    if (k < WHOLE)
        *whole[k] = which & 0x80 ? fuzz_u32(in) : fuzz_u8(in);
    else if (k < WHOLE + REAL)
        *real[k - WHOLE] = which & 0x80 ? (eits_real)fuzz_f32(in) : (eits_real)fuzz_u8(in) / 64;
    else if (k == WHOLE + REAL) {
        const uint8_t bits = fuzz_u8(in);
        o->sign = (eits_sign)(bits % 4);
        o->second_pass = bits / 4 % 2;
        o->touch_fit = EITS_TOUCH_FIT_ALL ^ (bits / 8u % 16u); /* beyond all: refused */
    } else
        o->solver = (eits_solver)(fuzz_u8(in) % 5);
}

/* Options that are refused change nothing; those taken are bounded, for time, in iterations and
 * sweeps only. */
static void change_options(twins *t, fuzz_bytes *in)
{
    eits_options wanted = *eits_get_options(t->ctx[0]);
    for (uint32_t changes = 1u + fuzz_u8(in) % 6u; changes > 0; --changes)
        change_option(&wanted, fuzz_u8(in), in);
    const eits_options before = *eits_get_options(t->ctx[0]);
    const eits_status status = eits_set_options(t->ctx[0], &wanted);
    MUST(status == EITS_OK || same_bits(&before, eits_get_options(t->ctx[0]), sizeof before));
    if (status != EITS_OK)
        return;
    wanted.iterations = 1 + (wanted.iterations - 1) % MAX_ITERATIONS;
    wanted.touch_sweeps %= MAX_SWEEPS + 1;
    for (int k = 0; k < t->count; ++k)
        MUST(eits_set_options(t->ctx[k], &wanted) == EITS_OK);
}

static void check_reference(const twins *t)
{
    eits_reference_info of[2];
    const eits_reference_info *a = &of[0], *b = &of[t->count - 1];
    for (int k = 0; k < t->count; ++k)
        MUST(eits_get_reference(t->ctx[k], &of[k]) == EITS_OK);
    MUST(a->ready == b->ready && a->count == b->count);
    const eits_real numbers[] = {a->v0_rms, a->gain, a->correlation, a->noise_v, a->lambda_noise};
    fuzz_note("reference", &a->ready, sizeof a->ready);
    fuzz_note("reference", &a->outliers, sizeof a->outliers);
    if (a->ready) {
        fuzz_note_reals("reference", numbers, sizeof numbers / sizeof numbers[0]);
        fuzz_note_reals("reference", a->v0, SMALL_ROWS);
    }
    if (!a->ready)
        return;
    MUST(same_bits(&a->gain, &b->gain, sizeof a->gain) &&
         same_bits(&a->lambda_noise, &b->lambda_noise, sizeof a->lambda_noise));
    MUST(eits_is_finite(a->gain) && a->gain != 0 && eits_is_finite(a->v0_rms) && a->v0_rms > 0);
    MUST(eits_is_finite(a->correlation) && eits_fabs(a->correlation) <= R(1.0001));
    MUST(eits_is_finite(a->noise_v) && a->noise_v >= 0 && eits_is_finite(a->lambda_noise) &&
         a->lambda_noise >= 0);
}

static void take_reference(twins *t, size_t length)
{
#define SET(ctx) eits_reference_set(ctx, t->frame, length)
    eits_reference_info before, after;
    MUST(eits_get_reference(t->ctx[0], &before) == EITS_OK);
    const eits_status status = BOTH(SET);
    MUST(length == SMALL_ROWS || status == EITS_E_FRAME_LENGTH);
    MUST(eits_get_reference(t->ctx[0], &after) == EITS_OK);
    MUST(after.ready == (status == EITS_OK ? 1 : before.ready));
}

static void learn_reference(twins *t, fuzz_bytes *in)
{
    const uint32_t count = fuzz_u8(in) % 8u;
#define BEGIN(ctx) eits_reference_begin(ctx, count)
#define ADD(ctx)   eits_reference_add(ctx, t->frame, SMALL_ROWS)
    MUST((BOTH(BEGIN) == EITS_OK) == (count >= 4));
    for (uint32_t k = 0; k < count; ++k) {
        read_frame(t, in);
        (void)BOTH(ADD);
    }
    (void)BOTH(eits_reference_finish);
}

static void reconstruct(twins *t, fuzz_bytes *in, int touches)
{
    uint64_t frame_macs = 0;
    uint32_t masked = 0;
    read_frame(t, in);
    /* a basis that is built meanwhile costs no more in what follows */
    if (eits_get_options(t->ctx[0])->mac_limit > 0)
        for (int k = 0; k < t->count; ++k)
            (void)eits_frame_stage(t->ctx[k], t->frame, SMALL_ROWS, &masked, &frame_macs);
#define RECONSTRUCT(ctx) eits_reconstruct(ctx, t->frame, SMALL_ROWS, NULL, NULL)
    const eits_status status = BOTH(RECONSTRUCT);
    same_results(t);
    fuzz_check_result(t->ctx[0], status, frame_macs);
    if (!touches)
        return;
    eits_touch found[2][EITS_MAX_TOUCHES];
    uint32_t count[2];
    for (int k = 0; k < t->count; ++k)
        MUST(eits_find_touches(t->ctx[k], found[k], EITS_MAX_TOUCHES, &count[k]) == EITS_OK);
    same_results(t); /* perhaps solved again */
    for (uint32_t j = 0; j < t->model.n_pixels; ++j)
        MUST(eits_is_finite(eits_get_image(t->ctx[0])[j]) &&
             eits_is_finite(eits_get_coefficients(t->ctx[0])[j]));
    MUST(t->count < 2 || count[0] == count[1]);
    for (uint32_t k = 0; t->count == 2 && k < count[0]; ++k) /* past the id: it may be padded */
        MUST(found[0][k].id == found[1][k].id &&
             same_bits(&found[0][k].x_mm, &found[1][k].x_mm, 5 * sizeof(eits_real)));
    MUST(status == EITS_OK || count[0] == 0);
    fuzz_check_touches(t->ctx[0], found[0], count[0]);
}

static void step(twins *t, fuzz_bytes *in)
{
    const uint8_t what = fuzz_u8(in);
    switch (what % 8) {
    case 0:
        read_frame(t, in), take_reference(t, what == 0xF8 ? SMALL_ROWS - 1 : SMALL_ROWS);
        break;
    case 1:
        learn_reference(t, in);
        break;
    case 2: {
        const uint32_t row = fuzz_u8(in) % (SMALL_ROWS + 1);
        for (int k = 0; k < t->count; ++k)
            MUST((eits_mask_row(t->ctx[k], row, what & 8) == EITS_OK) == (row < SMALL_ROWS));
        break;
    }
    case 3:
        change_options(t, in);
        break;
    case 4:
        for (int k = 0; k < t->count; ++k)
            eits_forget(t->ctx[k]);
        break;
    case 6:
        reconstruct(t, in, 1);
        break;
    default:
        reconstruct(t, in, 0);
        break;
    }
    check_reference(t);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static twins t;
    if (blobs[0].blob == NULL)
        make_models();
    fuzz_bytes in = {data, data + size};
    open_twins(&t, fuzz_u8(&in));
    small_reference(&t.model, 1.0, t.frame);
    for (int steps = 0; steps < STEPS && in.at < in.end; ++steps)
        step(&t, &in);
    return 0;
}

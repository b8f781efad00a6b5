/* The former contents of the scratch memory, and of the gaps between arrays, do not change a
 * result. */
#include "steps.h"

enum { RANK = 12, SIDE = 12, N = SIDE * SIDE, FRAMES = 24, KEPT_NOISE = 6 };

static const struct {
    const char *name;
    small_spec spec;
    int noise_known;
    eits_solver solver;
} SETTINGS[] = {
    {"waves, FISTA", {.rank = RANK, .side = SIDE, .shape = SMALL_WAVES}, 0, EITS_SOLVER_FISTA},
    {"waves, noise known, active set",
     {.rank = RANK, .side = SIDE, .shape = SMALL_WAVES},
     1,
     EITS_SOLVER_ACTIVE_SET},
    {"with fields, working set",
     {.rank = RANK, .side = SIDE, .fields = 1},
     0,
     EITS_SOLVER_WORKING_SET},
    {"with fields, noise known, FISTA",
     {.rank = RANK, .side = SIDE, .fields = 1},
     1,
     EITS_SOLVER_FISTA},
    {"whitened, f16, active set",
     {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .storage = EITS_STORAGE_F16},
     0,
     EITS_SOLVER_ACTIVE_SET},
    {"whitened, f16, noise known, working set",
     {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .storage = EITS_STORAGE_F16},
     1,
     EITS_SOLVER_WORKING_SET},
    {"whitened, ratios, FISTA",
     {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .kind = EITS_DATA_NORMALISED},
     0,
     EITS_SOLVER_FISTA},
    {"whitened, ratios, noise known, active set",
     {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .kind = EITS_DATA_NORMALISED},
     1,
     EITS_SOLVER_ACTIVE_SET},
};

static void fill(eits_real *v, size_t from, size_t to, eits_real with)
{
    for (size_t i = from; i < to; ++i)
        v[i] = with;
}

/* The rows' own padding stays zero: kernels read it. */
static void spoil(eits_context *ctx, eits_real with)
{
    const size_t rank = ctx->model->rank, pixels = ctx->model->n_pixels,
                 folds = ctx->model->n_folded, list = pixels > folds ? pixels : folds,
                 room = EITS_ALIGN16(folds * sizeof(eits_real)) / sizeof(eits_real);
    const eits_scratch *s = &ctx->scratch;
    fill(s->value, 0, list, with);
    memset(s->index, 0, list * sizeof *s->index);
    for (int k = 0; k < EITS_SCRATCH_ROWS; ++k)
        fill(s->row[k], 0, rank, with);
    for (int k = 0; k < EITS_SCRATCH_PIXELS; ++k)
        fill(s->pixel[k], 0, pixels, with);
    for (size_t i = 0; i < rank; ++i)
        fill(s->square + i * EITS_STRIDE(rank), 0, rank, with);
    fill(ctx->frame.d, folds, room, with);
    fill(ctx->frame.reciprocity_error, folds, room, with);
    fill(ctx->projection.gain_drift, folds, room, with);
    fill(ctx->range.off_range, folds, room, with);
}

static eits_context *set_up(dense_bench *b, small_spec spec, int noise_known, eits_solver solver)
{
    eits_context *ctx = dense_bench_open(b, spec, 0);
    uint64_t state = 5;
    eits_real frame[SMALL_ROWS], v[KEPT_NOISE][SMALL_ROWS];
    CHANGE_OPTIONS(ctx, o.solver = solver, o.warm_start = 1, o.max_masked = SMALL_ROWS);
    small_reference(&b->c.model, 1, frame);
    if (!noise_known) {
        CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
        return ctx;
    }
    for (int k = 0; k < KEPT_NOISE; ++k)
        vary(v[k], frame, 1e-3, &state);
    LEARN(ctx, KEPT_NOISE, v);
    return ctx;
}

/* A change of 5 %, pairs alike but for 0.1 %; in every other frame a reading that may or may not
 * count as wrong; in some an electrode's rows are lost. */
static void make_frame(const eits_model *model, int k, uint64_t *state, eits_real *frame)
{
    small_reference(model, 1, frame);
    for (uint32_t f = 0; f < model->n_folded; ++f) {
        const eits_fold fold = model->fold[f];
        const double change = 0.05 * small_random(state);
        frame[fold.first] *= (eits_real)(1 + change);
        if (fold.second != EITS_FOLD_NONE)
            frame[fold.second] *= (eits_real)(1 + change + 1e-3 * small_random(state));
    }
    const uint32_t at = model->fold[k % SMALL_PAIRS].first;
    if (k % 2)
        frame[at] *= (eits_real)(1 + 0.02 * small_random(state));
    for (uint32_t i = 0; i < SMALL_ROWS && k % 6 == 5; ++i)
        frame[i] = model->protocol[4 * (size_t)i] == k % SMALL_ELECTRODES ? R(NAN) : frame[i];
}

/* One frame on a context as it is and on one with junk in its scratch: the same result. */
static void check_frame(eits_context *ctx, eits_context *spoilt, const eits_real *frame)
{
    eits_touch touches[2][EITS_MAX_TOUCHES];
    uint32_t count[2];
    const eits_status status = eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL);
    CHECK_EQUAL(eits_reconstruct(spoilt, frame, SMALL_ROWS, NULL, NULL), status);
    CHECK(memcmp(ctx->rows.unusable, spoilt->rows.unusable, SMALL_ROWS) == 0);
    CHECK(memcmp(&ctx->info, &spoilt->info, sizeof ctx->info) == 0);
    if (status != EITS_OK)
        return;
    CHECK(memcmp(eits_get_image(ctx), eits_get_image(spoilt), N * sizeof(eits_real)) == 0);
    CHECK_OK(eits_find_touches(ctx, touches[0], EITS_MAX_TOUCHES, &count[0]));
    CHECK_OK(eits_find_touches(spoilt, touches[1], EITS_MAX_TOUCHES, &count[1]));
    CHECK_EQUAL(count[1], count[0]);
    for (uint32_t t = 0; t < count[0] && t < count[1]; ++t)
        CHECK(small_same_touch(&touches[0][t], &touches[1][t]));
}

TEST(what_lies_in_the_scratch_makes_no_difference)
{
    static const double junk[] = {NAN, 1e30, -1e-30};
    EACH_ROW(row, SETTINGS) {
        dense_bench clean = {0}, spoilt = {0};
        eits_context *ctx = set_up(&clean, row->spec, row->noise_known, row->solver),
                     *other = set_up(&spoilt, row->spec, row->noise_known, row->solver);
        uint64_t state = 17;
        for (int k = 0; k < FRAMES; ++k) {
            eits_real frame[SMALL_ROWS];
            make_frame(&clean.c.model, k, &state, frame);
            spoil(other, (eits_real)junk[k % 3]);
            check_frame(ctx, other, frame);
        }
        dense_bench_close(&clean);
        dense_bench_close(&spoilt);
    }
}

RUN_TESTS("scratch")

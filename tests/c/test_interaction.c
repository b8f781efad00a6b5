/* The interaction of touches, compared with fields that are induced shape by shape; the cases in
 * which it is not corrected; and v0 log(v / v0). */
#include "steps.h"

#include "diagnostics/diagnostics.h"
#include "kernels/kernels.h"
#include "touch/interaction.h"

static dense_bench b;
static eits_real frame[SMALL_ROWS];

enum { RANK = 16, SIDE = 12, L = SMALL_ELECTRODES };
static const small_spec WITH_FIELDS = {.rank = RANK, .side = SIDE, .fields = 1};
static const eits_disc THREE[] = {
    {-14, 3, 8, R(0.02), 1}, {9, 11, 6, R(-0.01), -1}, {5, -17, 10, R(0.03), 1}};

/* A context with a frame's data, where rows of fold `left_out` (below 0: none) are not in use. */
static eits_context *open_bench(dense_bench *b, small_spec spec, int left_out)
{
    eits_context *ctx = dense_bench_open(b, spec, 0);
    CHANGE_OPTIONS(ctx, o.project_reference = 0, o.max_masked = SMALL_ROWS);
    uint64_t state = 3;
    small_reference(&b->c.model, 1, frame);
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    vary(frame, frame, 0.05, &state);
    if (left_out >= 0)
        mask_fold(ctx, (uint32_t)left_out);
    STAGE(ctx, frame);
    return ctx;
}

/* ---- the computation shape by shape ---- */

static const eits_poles DISCS = {.orders = EITS_POLE_DISC_ORDERS, .sent = 2};

/* Add `sign` times the answers of all shapes in their present fields to the folds' data. */
static void add_answers(eits_context *ctx, const eits_shape *shape, uint32_t count, double sign,
                        double *data)
{
    for (uint32_t k = 0; k < count; ++k) {
        eits_real value[SMALL_FOLDED];
        const eits_pole_out out = {.value = value};
        (void)eits_pole_rows(ctx, k, &shape[k], &DISCS, 0, SMALL_FOLDED, &out);
        for (int f = 0; f < SMALL_FOLDED; ++f)
            data[f] += sign * (double)value[f];
    }
}

static void go_home(eits_context *ctx, const eits_shape *shape, uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k)
        (void)eits_pole_home(ctx, k, &shape[k]);
    eits_pole_clear(ctx, count);
}

/* The induced fields of all shapes, less what each gets from its own image: that is all it gets
 * when it is alone. */
static void induce_by_others(eits_context *ctx, const eits_shape *shape, uint32_t count)
{
    enum { SLOT = 2 * L * EITS_POLE_TERMS };
    eits_real own[3][SLOT], *induced = ctx->multipole.induced;
    for (uint32_t k = 0; k < count; ++k) {
        go_home(ctx, &shape[k], 1);
        (void)eits_pole_induced(ctx, &shape[k], 1, &DISCS, 1);
        eits_copy(own[k], induced, SLOT);
    }
    go_home(ctx, shape, count);
    (void)eits_pole_induced(ctx, shape, count, &DISCS, 1);
    for (uint32_t k = 0; k < count; ++k) {
        for (uint32_t i = 0; i < SLOT; ++i)
            induced[SLOT * k + i] -= own[k][i];
    }
}

/* P of the interaction, rows of folds that are left out ignored. */
static void dense_interaction(eits_context *ctx, const dense *d, const eits_disc *disc,
                              uint32_t count, double *added)
{
    eits_shape shape[3];
    double data[SMALL_FOLDED] = {0};
    for (uint32_t k = 0; k < count; ++k)
        shape[k] = eits_disc_as_shape(ctx, &disc[k]);
    go_home(ctx, shape, count);
    add_answers(ctx, shape, count, -1, data);
    induce_by_others(ctx, shape, count);
    add_answers(ctx, shape, count, 1, data);
    memset(added, 0, d->rank * sizeof *added);
    double *directions = dense_numbers((size_t)d->rank * d->folded);
    uint32_t out = 0;
    for (uint32_t k = 0; k < d->folded; ++k) {
        const int used = ctx->frame.sides[k] != EITS_SIDE_NONE;
        for (uint32_t i = 0; i < d->rank; ++i) {
            added[i] += used ? data[k] * d->p[(size_t)k * d->rank + i] : 0;
            directions[(size_t)out * d->rank + i] = d->p[(size_t)k * d->rank + i];
        }
        out += !used;
    }
    dense_project_out(added, directions, out, d->rank);
    free(directions);
}

/* ctx->frame.y less what eits_remove_interaction leaves of it, |y| made so great that no limit is
 * reached. */
static void interplay(eits_context *ctx, const eits_disc *disc, uint32_t count, double *added,
                      uint64_t *macs)
{
    eits_real data[RANK + 8];
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) /* nobody's: whatever is in it */
        ctx->scratch.value[j] = R(NAN);
    *macs = eits_remove_interaction(ctx, &ctx->scratch, disc, count, data);
    for (uint32_t i = 0; i < ctx->model->rank; ++i)
        added[i] = (double)ctx->frame.y[i] - (double)data[i];
}

static double size_of(const double *a)
{
    return sqrt(dense_dot(a, a, RANK));
}

TEST(as_computed_shape_by_shape)
{
    for (int left_out = -1; left_out < 12; left_out += 4) {
        double added[RANK], expected[RANK];
        uint64_t macs;
        eits_context *ctx = open_bench(&b, WITH_FIELDS, left_out);
        for (uint32_t count = 2; count <= 3; ++count) {
            dense_interaction(ctx, &b.d, THREE, count, expected);
            interplay(ctx, THREE, count, added, &macs);
            CHECK(size_of(expected) > 1e-3);
            for (int i = 0; i < RANK; ++i)
                CHECK_NEAR(added[i], expected[i],
                           BOTH_WIDTHS(2e-5, 1e-12) * (size_of(expected) + size_of(added)) +
                               4 * EPS * fabs((double)ctx->frame.y[i]));
        }
        CHECK(left_out < 0 || ctx->frame.sides[left_out] == EITS_SIDE_NONE);
    }
}

/* The products, counted one by one: polynomials of the fields, induced fields, answers in both
 * fields, P of the folds in use, two norms. */
TEST(work_is_counted)
{
    static const eits_poles others = {.orders = EITS_POLE_DISC_ORDERS, .sent = 2, .of_others = 1};
    eits_real value[SMALL_FOLDED];
    const eits_pole_out out = {.value = value};
    eits_shape shape[3];
    double added[RANK];
    uint64_t macs, expected = SMALL_FOLDED * RANK + 2 * RANK;
    eits_context *ctx = open_bench(&b, WITH_FIELDS, -1);
    for (uint32_t k = 0; k < 3; ++k) {
        shape[k] = eits_disc_as_shape(ctx, &THREE[k]);
        expected += eits_pole_home(ctx, k, &shape[k]);
        expected += 2 * eits_pole_rows(ctx, k, &shape[k], &DISCS, 0, SMALL_FOLDED, &out);
    }
    expected += eits_pole_induced(ctx, shape, 3, &others, 1);
    eits_pole_forget(ctx);
    interplay(ctx, THREE, 3, added, &macs);
    CHECK_EQUAL(macs, expected);
}

/* Driven and measured pairs exchanged: the same datum, to what halves make of the mirror, and to
 * the orders that are left out: discs send two and answer with three. */
TEST(reciprocals_give_the_same)
{
    dense_bench b = {0}, turned = {0};
    double added[RANK], other[RANK];
    uint64_t macs;
    eits_context *ctx = open_bench(&b, WITH_FIELDS, -1);
    interplay(ctx, THREE, 3, added, &macs);
    small_model made = small_model_make(WITH_FIELDS);
    uint8_t *fold = small_model_section(&made, "FOLD", NULL);
    int exchanged = 0;
    for (int k = 0; k < SMALL_PAIRS; ++k, fold += 8) {
        uint8_t kept[2];
        if (fold[4] != 1) /* measured the other way round */
            continue;
        memcpy(kept, fold, 2), memcpy(fold, fold + 2, 2), memcpy(fold + 2, kept, 2);
        ++exchanged;
    }
    small_model_seal(&made);
    CHECK(exchanged > 10);
    eits_context *now = open_bench(&turned, WITH_FIELDS, -1);
    CHECK_OK(eits_model_open(&turned.c.model, made.blob, made.size));
    interplay(now, THREE, 3, other, &macs);
    for (int i = 0; i < RANK; ++i)
        CHECK_NEAR(other[i], added[i], 1e-2 * size_of(added));
    small_model_free(&made);
    dense_bench_close(&turned);
    dense_bench_close(&b);
}

/* A field that is the same everywhere, and no mirror: 1 / r^2 beyond touching, nothing more within,
 * nothing at all in one place. */
TEST(distance_and_overlap)
{
    double near[RANK], added[RANK];
    uint64_t macs;
    eits_context *ctx = open_bench(&b, WITH_FIELDS, -1);
    uint8_t *halves = small_model_section(&b.made, "FLDS", NULL) + 16;
    for (uint32_t j = 0; j < b.c.model.n_pixels; ++j, halves += 2 * SMALL_FIELDS_STRIDE) {
        for (uint32_t r = 0; r < 2 * L + 4; ++r)
            small_put_u16(halves + 2 * r, r == 2 * L ? 0x7BFFu
                                          : r > 2 * L
                                              ? 0
                                              : 0x3800u + (r < L ? 37 * r : 5 * (r - L) * (r - L)));
    }
    eits_disc two[2] = {{-18, 0, 6, R(0.03), 1}, {-6, 0, 6, R(0.03), 1}}; /* where they touch */
    interplay(ctx, two, 2, near, &macs);
    CHECK(size_of(near) > 0);
    const double tolerance = (4 * EPS * 10 + 1e-6) * size_of(near) + 40 * EPS;
    for (int step = 1; step <= 3; ++step) {
        two[1].x_mm = -18 + 12 * (eits_real)(step + 1);
        interplay(ctx, two, 2, added, &macs);
        for (int i = 0; i < RANK; ++i)
            CHECK_NEAR(added[i], near[i] / ((step + 1) * (step + 1)), tolerance);
    }
    for (int step = 1; step <= 2; ++step) { /* inside each other */
        two[1].x_mm = -18 + 4 * (eits_real)step;
        interplay(ctx, two, 2, added, &macs);
        for (int i = 0; i < RANK; ++i)
            CHECK_NEAR(added[i], near[i], tolerance);
    }
    two[1].x_mm = -18;
    interplay(ctx, two, 2, added, &macs);
    for (int i = 0; i < RANK; ++i)
        CHECK_NEAR(added[i], 0, tolerance); /* the mirror 65504 mm away */
}

/* Whether the data stay as they are, bit for bit. */
static int left_alone(eits_context *ctx, const eits_disc *disc, uint32_t count)
{
    eits_real data[RANK + 8];
    (void)eits_remove_interaction(ctx, &ctx->scratch, disc, count, data);
    return memcmp(data, ctx->frame.y, ctx->model->rank * sizeof *data) == 0;
}

TEST(when_it_is_left_alone)
{
    eits_context *ctx = open_bench(&b, WITH_FIELDS, -1);
    CHECK(eits_has_interaction(ctx) && !left_alone(ctx, THREE, 2));
    CHECK(left_alone(ctx, THREE, 1) && left_alone(ctx, THREE, 0));
    eits_disc strong[2] = {THREE[0], THREE[2]};
    double added[RANK], y[RANK];
    uint64_t macs;
    interplay(ctx, strong, 2, added, &macs);
    for (int i = 0; i < RANK; ++i)
        y[i] = (double)ctx->frame.y[i];
    /* a quarter of |y|^2; it grows as the product of the changes */
    const double max = 0.5 * size_of(y) / size_of(added);
    CHECK(max > 1);
    strong[0].change *= (eits_real)(0.99 * max);
    CHECK(!left_alone(ctx, strong, 2));
    strong[0].change *= R(1.02);
    CHECK(left_alone(ctx, strong, 2));
    CHANGE_OPTIONS(ctx, o.touch_fit = EITS_TOUCH_FIT_LOG_DATA | EITS_TOUCH_FIT_SPLIT_MERGE);
    CHECK(!eits_has_interaction(ctx) && left_alone(ctx, THREE, 2));
    static const small_spec others[] = {
        {.rank = RANK, .side = SIDE},
        {.rank = RANK, .side = SIDE, .fields = 1, .kind = EITS_DATA_LOG_RATIO},
        {.rank = RANK, .side = SIDE, .fields = 1, .kind = EITS_DATA_NORMALISED}};
    for (int k = 0; k < 3; ++k) {
        ctx = open_bench(&b, others[k], -1);
        /* differences need no fields */
        CHECK(!eits_has_interaction(ctx) && left_alone(ctx, THREE, 3) &&
              ctx->frame.has_y_log == (k == 0));
    }
}

/* The linear data of a model of differences are the data of the same matrices' model of log
 * ratios. */
TEST(log_data)
{
    for (int left_out = -1; left_out < 9; left_out += 3) {
        dense_bench b = {0}, log_bench = {0};
        eits_context *ctx = open_bench(&b, WITH_FIELDS, left_out);
        const small_spec spec = {
            .rank = RANK, .side = SIDE, .fields = 1, .kind = EITS_DATA_LOG_RATIO};
        eits_context *log_ctx = open_bench(&log_bench, spec, left_out);
        CHECK_EQUAL(ctx->frame.has_y_log, 1);
        CHECK(memcmp(ctx->frame.y_log, log_ctx->frame.y, RANK * sizeof *ctx->frame.y) == 0);
        CHECK(memcmp(ctx->frame.y, log_ctx->frame.y, RANK * sizeof *ctx->frame.y) != 0);
        uint32_t masked;
        uint64_t with = 0, without = 0;
        CHECK_OK(eits_frame_stage(ctx, frame, SMALL_ROWS, &masked, &with));
        CHANGE_OPTIONS(ctx, o.touch_fit = EITS_TOUCH_FIT_SPLIT_MERGE | EITS_TOUCH_FIT_INTERACTION);
        CHECK_OK(eits_frame_stage(ctx, frame, SMALL_ROWS, &masked, &without));
        CHECK_EQUAL(ctx->frame.has_y_log, 0);
        const uint32_t folds = SMALL_FOLDED - (left_out >= 0);
        CHECK(with - without >= folds * RANK && with - without <= (folds + 2) * RANK);
        dense_bench_close(&log_bench);
        dense_bench_close(&b);
    }
}

/* If the reference is nearly zero, there is no ratio: the difference is used, shared equally by
 * both sides of the fold. */
TEST(log_data_without_a_ratio)
{
    eits_real y[RANK];
    eits_context *ctx = open_bench(&b, WITH_FIELDS, -1);
    for (int i = 0; i < SMALL_ROWS; ++i)
        frame[i] = ctx->reference.v0[i];
    const eits_fold fold = b.c.model.fold[3];
    ctx->reference.v0[fold.first] = ctx->reference.v0[fold.second] = 0;
    frame[fold.first] = frame[fold.second] = R(0.01);
    CHANGE_OPTIONS(ctx, o.diagnostics = 0);
    STAGE(ctx, frame);
    eits_copy(y, ctx->frame.y, RANK);
    CHECK(eits_dot(ctx->kernels, y, y, RANK) > 0);
    for (int i = 0; i < RANK; ++i)
        CHECK_NEAR(ctx->frame.y_log[i], y[i], 4 * EPS * fabs((double)y[i]));
}

RUN_TESTS("coupling", dense_bench_close(&b))

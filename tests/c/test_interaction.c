/* The interaction of touches, compared with a dense computation in complex numbers; the cases in
 * which it is not corrected; and v0 log(v / v0). */
#include "steps.h"

#include "diagnostics/diagnostics.h"
#include "kernels/kernels.h"
#include "touch/interaction.h"

#include <complex.h>

static dense_bench b;
static eits_real frame[SMALL_ROWS];

enum { RANK = 16, SIDE = 12, L = SMALL_ELECTRODES };
static const double PIXEL = 6, PI = 3.14159265358979323846;
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

/* ---- the dense computation ---- */

typedef struct seen {
    double complex field[L]; /* E_x + i E_y of each electrode's current, averaged over the disc */
    double complex place, a, b;
    double moment;
} seen;

static seen look(const eits_model *m, const eits_disc *disc)
{
    seen s = {.place = (double)disc->x_mm + I * (double)disc->y_mm};
    double whole = 0, rows[2 * L + 4] = {0};
    for (uint32_t j = 0; j < m->n_pixels; ++j) {
        const double x = (double)m->origin_x_mm + (m->pixel[j].ix + 0.5) * PIXEL,
                     y = (double)m->origin_y_mm + (m->pixel[j].iy + 0.5) * PIXEL;
        const double fraction = 0.5 + ((double)disc->radius_mm - cabs(x + I * y - s.place)) / PIXEL;
        const double cover = fraction < 0 ? 0 : fraction > 1 ? 1 : fraction;
        whole += cover;
        for (uint32_t r = 0; r < 2 * L + 4; ++r)
            rows[r] += cover * dense_entry(&m->fields.at, j, r);
    }
    for (uint32_t e = 0; e < L; ++e)
        s.field[e] = (rows[e] + I * rows[L + e]) / whole;
    s.a = (rows[2 * L] + I * rows[2 * L + 1]) / whole;
    s.b = (rows[2 * L + 2] + I * rows[2 * L + 3]) / whole;
    s.moment = (double)disc->change * PI *
               ((double)(disc->radius_mm * disc->radius_mm) + PIXEL * PIXEL / 12);
    return s;
}

/* The field that a dipole of `moment` times the vector e, at `from`, has at `at`, by vectors: s (2
 * (e.u) u - e) / r^2. */
static double complex direct(double complex e, double complex at, double complex from, double s,
                             double touching)
{
    const double r = cabs(at - from), reach = r > touching ? r : touching;
    if (r == 0)
        return 0;
    const double complex u = (at - from) / r;
    return s / (reach * reach) * (2 * (creal(e) * creal(u) + cimag(e) * cimag(u)) * u - e);
}

/* P of the interaction, rows of folds that are left out ignored; folds' second rows give the same.
 */
static void dense_interaction(const eits_context *ctx, const dense *d, const eits_disc *disc,
                              uint32_t count, double *added)
{
    const eits_model *m = ctx->model;
    seen s[4];
    memset(added, 0, d->rank * sizeof *added);
    for (uint32_t i = 0; i < count; ++i)
        s[i] = look(m, disc + i);
    double *directions = dense_numbers((size_t)d->rank * d->folded);
    uint32_t out = 0;
    for (uint32_t k = 0; k < d->folded; ++k) {
        const uint8_t *row = m->protocol + 4 * (size_t)m->fold[k].first;
        double datum = 0;
        for (uint32_t i = 0; i < count; ++i) {
            double complex induced = 0;
            for (uint32_t j = 0; j < count; ++j) {
                const double complex e = s[j].field[row[0]] - s[j].field[row[1]],
                                     far = s[j].a - s[j].b * s[i].place;
                const double per = s[j].moment * (double)m->fields.per_sheet;
                if (i != j)
                    induced += direct(e, s[i].place, s[j].place, per,
                                      (double)(disc[i].radius_mm + disc[j].radius_mm)) -
                               conj(per * conj(e) / (far * far));
            }
            const double complex measured = s[i].field[row[2]] - s[i].field[row[3]];
            datum -= (double)m->fields.volts * s[i].moment *
                     (creal(induced) * creal(measured) + cimag(induced) * cimag(measured));
        }
        const int used = ctx->frame.sides[k] != EITS_SIDE_NONE;
        for (uint32_t i = 0; i < d->rank; ++i) {
            added[i] += used ? datum * d->p[(size_t)k * d->rank + i] : 0;
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

TEST(as_computed_densely)
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

/* The products, counted one by one: fields over covers, non-linearity, answers, P of the folds in
 * use, two norms. */
TEST(work_is_counted)
{
    eits_real field[SMALL_FIELDS_STRIDE];
    double added[RANK];
    uint64_t macs, expected = 0;
    eits_context *ctx = open_bench(&b, WITH_FIELDS, -1);
    for (int k = 0; k < 3; ++k)
        expected += eits_disc_field(ctx, &ctx->scratch, &THREE[k], field);
    CHECK_EQUAL(expected % (2 * L + 4), 0);
    interplay(ctx, THREE, 3, added, &macs);
    CHECK_EQUAL(macs,
                expected + 3 * (2 * 4 * L + 3 * SMALL_FOLDED) + SMALL_FOLDED * RANK + 2 * RANK);
}

/* Driven and measured pairs exchanged: the same datum, to what halves make of the mirror. */
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
        CHECK_NEAR(other[i], added[i], 2e-3 * size_of(added));
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
    /* fields of three discs and one more do not fit into the factor of rank 9: 9 x 16 numbers hold
     * six of 24 */
    const small_spec low = {.rank = 9, .side = SIDE, .fields = 1};
    eits_disc many[6] = {THREE[0],
                         THREE[1],
                         THREE[2],
                         {-20, -20, 5, R(0.01), 1},
                         {20, 20, 5, R(0.01), 1},
                         {20, -4, 5, R(0.01), 1}};
    ctx = open_bench(&b, low, -1);
    CHECK(!left_alone(ctx, many, 5));
    CHECK(left_alone(ctx, many, 6));
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

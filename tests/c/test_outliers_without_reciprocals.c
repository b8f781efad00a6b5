/* Outliers that only the other folds show: in half scans, whose second rows are copies; the wrong
 * side of a fold; and channels, in which many folds share a pair. */
#include "steps.h"

#include "diagnostics/diagnostics.h"

enum {
    RANK = 8,
    SIDE = 4,
    UNTOUCHED = 16,
    BLOCKS = 6,
    ALONE = RANK - 1,
    UNSEEN = SMALL_PAIRS,
    PAIR_FOLDS = 12
};

/* A sheet in which folds 0 to 14 agree by threes, the single row 20 with folds 16 and 17, and folds
 * 15 and 18 with none. Of the single row 19 the model sees nothing. */
static uint32_t block_of(uint32_t k)
{
    if (k == UNSEEN)
        return RANK;
    if (k == 15 || k == 18)
        return k == 15 ? BLOCKS : ALONE;
    return k < 15 ? k / 3 : BLOCKS - 1;
}

typedef struct bench {
    dense_bench on;
    eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
    uint64_t state;
    int half; /* second rows are copies */
} bench;

static bench b;

static void shape_reduction(small_model *made)
{
    uint8_t *p = small_model_section(made, "REDU", NULL);
    for (uint32_t i = 0; i < RANK; ++i) {
        const double weight = 1 / sqrt(pow(SMALL_DECAY, 2.0 * i) + SMALL_REGULARISATION);
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
            small_put_f32(p + 4 * (RANK * k + i),
                          block_of(k) == i ? (float)(i < BLOCKS ? weight / sqrt(3) : weight)
                                           : 0.0f);
    }
}

/* The first folds all drive across the pair (0, 1) and measure across another, or the other way
 * round; `crossed`: across (0, x) and (1, y) instead. */
static void shape_protocol(small_model *made, int crossed)
{
    uint8_t *rows = small_model_section(made, "PROT", NULL),
            *folds = small_model_section(made, "FOLD", NULL);
    for (uint32_t k = 0; k < PAIR_FOLDS; ++k) {
        const uint8_t from = (uint8_t)(2 + k % 5), to = (uint8_t)(from + 1), zero = k % 4 == 3;
        const uint8_t one[2] = {zero, crossed ? from : !zero},
                      other[2] = {crossed ? !zero : from, to};
        uint8_t *fold = folds + 8 * k, *first = rows + 4 * (fold[0] | fold[1] << 8),
                *second = rows + 4 * (fold[2] | fold[3] << 8);
        memcpy(first, k % 3 == 1 ? one : other, 2);
        memcpy(first + 2, k % 3 == 1 ? other : one, 2);
        memcpy(second, first + 2, 2);
        memcpy(second + 2, first, 2);
    }
    small_model_hash(made, SMALL_ELECTRODES, SMALL_ROWS, rows);
}

static void copy_halves(const bench *b, eits_real *frame)
{
    for (uint32_t k = 0; k < SMALL_PAIRS && b->half; ++k) {
        const eits_fold fold = b->on.c.model.fold[k];
        frame[fold.second] = (eits_real)fold.sign * frame[fold.first];
    }
}

static void add_noise(bench *b, eits_real *frame)
{
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        frame[i] += (eits_real)(1e-4 * small_random(&b->state));
    copy_halves(b, frame);
}

/* A frame within the model's range, `size` large, and noise. */
static void clean_frame(bench *b, double size)
{
    double change[RANK + 1];
    for (uint32_t i = 0; i <= RANK; ++i)
        change[i] = i < RANK ? size * small_random(&b->state) : 0;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = b->on.c.model.fold[k];
        b->frame[fold.first] = b->reference[fold.first] + (eits_real)change[block_of(k)];
        if (fold.second != EITS_FOLD_NONE)
            b->frame[fold.second] =
                b->reference[fold.second] + (eits_real)fold.sign * (eits_real)change[block_of(k)];
    }
    add_noise(b, b->frame);
}

enum { PLAIN, PAIR, CROSSED };

static eits_context *open_shaped(bench *b, int protocol, int half, eits_data_kind kind)
{
    small_model made = small_model_make(
        (small_spec){.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .kind = kind});
    shape_reduction(&made);
    if (protocol != PLAIN)
        shape_protocol(&made, protocol == CROSSED);
    eits_context *ctx = dense_bench_take(&b->on, made, 0);
    b->state = 7;
    b->half = half;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = b->on.c.model.fold[k];
        b->reference[fold.first] = 1;
        if (fold.second != EITS_FOLD_NONE)
            b->reference[fold.second] = (eits_real)fold.sign;
    }
    CHANGE_OPTIONS(ctx, o.project_reference = 0, o.max_masked = SMALL_ROWS);
    CHECK_OK(eits_reference_begin(ctx, UNTOUCHED));
    for (int k = 0; k < UNTOUCHED; ++k) {
        clean_frame(b, 0);
        CHECK_OK(eits_reference_add(ctx, b->frame, SMALL_ROWS));
    }
    CHECK_OK(eits_reference_finish(ctx));
    CHECK(ctx->range.known && ctx->reference.noise_v > 0);
    return ctx;
}

static eits_context *set_up(bench *b, int half)
{
    return open_shaped(b, PLAIN, half, EITS_DATA_DIFFERENCE);
}

static void look_for(eits_context *ctx, uint32_t diagnostics, uint32_t max_masked)
{
    CHANGE_OPTIONS(ctx, o.diagnostics = diagnostics, o.max_masked = max_masked);
}

/* Returns the diagnostics of the rows, without `crowded`, which means nothing for the touches of
 * the small model. */
static uint32_t reconstruct(bench *b)
{
    CHECK_OK(eits_reconstruct(b->on.c.ctx, b->frame, SMALL_ROWS, NULL, NULL));
    return b->on.c.ctx->info.diagnostics &
           ~(uint32_t)(EITS_DIAGNOSTIC_CROWDED | EITS_DIAGNOSTIC_STALE_REFERENCE);
}

/* Row and copy of fold k are off by `off`. */
static void spoil(bench *b, uint32_t k, double off)
{
    b->frame[b->on.c.model.fold[k].first] += (eits_real)off;
    copy_halves(b, b->frame);
}

TEST(clean_half_scans)
{
    for (int project = 0; project < 2; ++project) {
        eits_context *ctx = set_up(&b, 1);
        CHANGE_OPTIONS(ctx, o.project_reference = (uint32_t)project);
        CHECK_OK(eits_reference_set(ctx, b.reference, SMALL_ROWS));
        for (int k = 0; k < 40; ++k) {
            clean_frame(&b, k % 2 ? 0.15 : 0.001);
            CHECK_EQUAL(reconstruct(&b), 0);
            CHECK_EQUAL(ctx->info.masked, 0);
            CHECK(ctx->info.model_mismatch < EITS_MISMATCH_FRACTION || k % 2 == 0);
        }
    }
}

/* Left out with its copy, and counted; the image is that of a frame whose rows were known to be
 * bad. */
TEST(one_outlier_of_a_half_scan)
{
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        eits_context *ctx = set_up(&b, 1);
        const eits_fold fold = b.on.c.model.fold[k];
        const uint32_t rows = fold.second == EITS_FOLD_NONE ? 1 : 2;
        eits_real data[RANK];
        clean_frame(&b, 0.15);
        spoil(&b, k, 0.6);
        const uint32_t found = reconstruct(&b);
        if (k == 15 || k == 18) { /* a fold that no other predicts may have any value */
            CHECK(found == 0 && ctx->info.masked == 0);
            continue;
        }
        CHECK_EQUAL(found, EITS_DIAGNOSTIC_OUTLIER);
        CHECK_EQUAL(ctx->info.outliers, rows);
        CHECK_EQUAL(ctx->info.masked, rows);
        CHECK(ctx->info.model_mismatch == 0 && ctx->rows.unusable[fold.first] == EITS_ROW_OUTLIER);
        memcpy(data, ctx->frame.y, sizeof data);
        look_for(ctx, EITS_DIAGNOSTICS_ALL, rows - 1);
        CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ROWS);
        CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_OUTLIER);
        CHECK_EQUAL(ctx->info.outliers, rows);
        look_for(ctx, EITS_DIAGNOSTICS_ALL & ~(uint32_t)EITS_DIAGNOSTIC_OUTLIER, SMALL_ROWS);
        CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_MODEL_MISMATCH);
        CHECK(ctx->info.model_mismatch > EITS_MISMATCH_FRACTION && ctx->info.model_mismatch <= 1 &&
              ctx->info.masked == 0);
        look_for(ctx, 0, SMALL_ROWS);
        CHECK_EQUAL(reconstruct(&b), 0);
        CHECK_EQUAL(ctx->info.masked, 0);
        look_for(ctx, EITS_DIAGNOSTICS_ALL, SMALL_ROWS);
        mask_fold(ctx, k);
        CHECK_EQUAL(reconstruct(&b), 0);
        CHECK(memcmp(data, ctx->frame.y, sizeof data) == 0);
    }
}

/* Without reciprocals the core cannot decide which of several rows is the outlier. Reciprocals that
 * differ by no more than noise are no outliers. */
TEST(mismatches_that_are_no_outlier)
{
    eits_context *ctx = set_up(&b, 1);
    clean_frame(&b, 0.15);
    for (uint32_t k = 0; k < 9; k += 3)
        spoil(&b, k, 0.6);
    CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_MODEL_MISMATCH);
    CHECK(ctx->info.masked == 0 && ctx->info.outliers == 0);
    clean_frame(&b, 0.15); /* noise all over: nothing stands out of it */
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
        spoil(&b, k, 0.05 * small_random(&b.state));
    spoil(&b, 4, 0.4);
    CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_MODEL_MISMATCH);
    CHECK_EQUAL(ctx->info.masked, 0);
    clean_frame(&b, 0.02); /* a lesser one beside it does not matter */
    spoil(&b, 0, 0.6);
    spoil(&b, 3, 0.36);
    CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_OUTLIER);
    CHECK(ctx->info.outliers == 2 &&
          ctx->rows.unusable[b.on.c.model.fold[0].first] == EITS_ROW_OUTLIER);
    clean_frame(&b, 0.02); /* a fold that none determines is not blamed, however large */
    spoil(&b, 18, 6);
    for (uint32_t k = 0; k < 9; k += 3)
        spoil(&b, k, 0.3);
    CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_MODEL_MISMATCH);
    CHECK_EQUAL(ctx->info.masked, 0);
    clean_frame(&b, 0.02); /* rows that have turned, though one stands out */
    spoil(&b, 0, -7);
    spoil(&b, 3, -1.1);
    CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_MODEL_MISMATCH);
    CHECK_EQUAL(ctx->info.masked, 0);
    ctx = set_up(&b, 0);
    clean_frame(&b, 0.15);
    const eits_fold fold = b.on.c.model.fold[5];
    b.frame[fold.first] += R(0.6);
    b.frame[fold.second] += (eits_real)fold.sign * R(0.6);
    CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_MODEL_MISMATCH);
    CHECK_EQUAL(ctx->info.masked, 0);
}

/* A drift of the gain causes no mismatch if it is projected out; an outlier beside it is found. */
TEST(drift_is_no_mismatch)
{
    eits_context *ctx = set_up(&b, 0);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) { /* a reference that the model cannot give */
        const eits_fold fold = b.on.c.model.fold[k];
        b.reference[fold.first] *= R(1) + R(0.1) * (eits_real)(k % 3);
        if (fold.second != EITS_FOLD_NONE)
            b.reference[fold.second] *= R(1) + R(0.1) * (eits_real)(k % 3);
    }
    CHECK_OK(eits_reference_begin(ctx, UNTOUCHED));
    for (int k = 0; k < UNTOUCHED; ++k) {
        clean_frame(&b, 0);
        CHECK_OK(eits_reference_add(ctx, b.frame, SMALL_ROWS));
    }
    CHECK_OK(eits_reference_finish(ctx));
    for (int project = 0; project < 2; ++project) {
        CHANGE_OPTIONS(ctx, o.project_reference = (uint32_t)project);
        clean_frame(&b, 0.02);
        CHECK_EQUAL(reconstruct(&b), 0);
        for (int i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] += R(0.2) * b.reference[i];
        CHECK_EQUAL(reconstruct(&b), project ? 0 : EITS_DIAGNOSTIC_MODEL_MISMATCH);
        CHECK((ctx->info.model_mismatch < R(0.01)) == project);
        const eits_fold fold = b.on.c.model.fold[7];
        b.frame[fold.first] += R(0.05);
        b.frame[fold.second] += (eits_real)fold.sign * R(0.05);
        CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_MODEL_MISMATCH);
    }
}

/* If the two sides of a fold differ, the side that the other rows predict stays. */
TEST(the_wrong_side_goes)
{
    for (int kind = 0; kind < 3; ++kind) {
        for (uint32_t k = 0; k < SMALL_PAIRS; ++k) {
            eits_context *ctx = open_shaped(&b, PLAIN, 0, (eits_data_kind)kind);
            const eits_fold fold = b.on.c.model.fold[k];
            for (int side = 0; side < 2; ++side) {
                const uint32_t wrong = side ? fold.second : fold.first,
                               right = side ? fold.first : fold.second;
                clean_frame(&b, 0.15);
                b.frame[wrong] *= R(1.5);
                CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_OUTLIER);
                CHECK_EQUAL(ctx->rows.unusable[wrong], EITS_ROW_OUTLIER);
                CHECK_EQUAL(ctx->rows.unusable[right], block_of(k) < BLOCKS ? 0 : EITS_ROW_OUTLIER);
                CHECK_EQUAL(ctx->info.outliers, block_of(k) < BLOCKS ? 1 : 2);
            }
        }
    }
}

/* Two of three related folds are wrong: the third shows this, also for a small one beside a large
 * one. If one fold is left out, nothing shows it. */
TEST(several_wrong_sides)
{
    static const double FACTORS[3][2] = {{1.4, 1.6}, {1.3, 5}, {5, 1.3}};
    eits_context *ctx = set_up(&b, 0);
    for (uint32_t count = 1; count <= 3 * EITS_OUTLIER_MAX; ++count) {
        const uint32_t wrong = (count - 1) / 3 + 1;
        clean_frame(&b, 0.15);
        for (uint32_t l = 0; l < wrong; ++l) { /* folds 0, 1, 3, 4, ... */
            const eits_fold fold = b.on.c.model.fold[l + l / 2];
            b.frame[l % 3 ? fold.first : fold.second] *= (eits_real)FACTORS[count % 3][l % 2];
        }
        CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_OUTLIER);
        CHECK_EQUAL(ctx->info.outliers, wrong);
        for (uint32_t l = 0; l < wrong; ++l) {
            const eits_fold fold = b.on.c.model.fold[l + l / 2];
            CHECK_EQUAL(ctx->rows.unusable[l % 3 ? fold.first : fold.second], EITS_ROW_OUTLIER);
        }
    }
    clean_frame(&b, 0.15);
    CHECK_OK(eits_mask_row(ctx, b.on.c.model.fold[UNSEEN].first, 1));
    b.frame[b.on.c.model.fold[2].first] *= R(1.5);
    CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_OUTLIER);
    CHECK_EQUAL(ctx->info.outliers, 2);
}

/* The thresholds, from both sides: noise, the fraction of the largest datum, the fraction of their
 * own.
 */
TEST(what_sides_may_differ_by)
{
    static const struct {
        double change, off, largest; /* of fold 4, of its second side, of fold 0 */
        int found;
    } CASES[] = {{0, 6e-4, 0, 1},   {0, 3e-4, 0, 0},   {0, 0.02, 0.5, 1},   {0, 0.01, 0.5, 0},
                 {0.3, 0.12, 0, 1}, {0.3, 0.08, 0, 0}, {-0.3, -0.08, 0, 0}, {-0.3, -0.12, 0, 1}};
    for (size_t n = 0; IN_TABLE(n, CASES); ++n) {
        eits_context *ctx = set_up(&b, 0);
        CHECK(ctx->reference.noise_v > R(4e-5) && ctx->reference.noise_v < R(7e-5));
        look_for(ctx, EITS_DIAGNOSTIC_OUTLIER, SMALL_ROWS);
        memcpy(b.frame, b.reference, sizeof b.frame);
        for (uint32_t k = 0; k < 6; ++k) {
            const eits_fold fold = b.on.c.model.fold[k];
            const eits_real change = (eits_real)(k < 3 ? CASES[n].largest : CASES[n].change);
            b.frame[fold.first] += change;
            b.frame[fold.second] +=
                (eits_real)fold.sign * (change + (k == 4 ? (eits_real)CASES[n].off : 0));
        }
        /* the frame against its own reference's noise */
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] += ctx->reference.v0[i] - b.reference[i];
        CHECK_EQUAL(reconstruct(&b), CASES[n].found ? EITS_DIAGNOSTIC_OUTLIER : 0);
    }
}

static int measures_across(const eits_context *ctx, uint32_t i)
{
    const uint8_t *row = eits_row(ctx, i);
    return (row[2] == 0 && row[3] == 1) || (row[2] == 1 && row[3] == 0);
}

static int uses_either(const eits_context *ctx, uint32_t i)
{
    int uses = 0;
    for (int p = 0; p < 4; ++p)
        uses |= eits_row(ctx, i)[p] <= 1;
    return uses;
}

/* The channel of one pair: the rows measured across it go, their reciprocals stay. Of two
 * electrodes that share no channel, all. */
TEST(noisy_channel)
{
    for (int crossed = 0; crossed < 2; ++crossed) {
        eits_context *ctx = open_shaped(&b, crossed ? CROSSED : PAIR, 0, EITS_DATA_DIFFERENCE);
        clean_frame(&b, 0.02);
        for (uint32_t k = 0; k < PAIR_FOLDS; ++k) {
            const eits_fold fold = b.on.c.model.fold[k];
            b.frame[measures_across(ctx, fold.second) ? fold.second : fold.first] *= R(1.3);
        }
        CHECK_EQUAL(reconstruct(&b), EITS_DIAGNOSTIC_ELECTRODE_NOISY);
        CHECK_EQUAL(ctx->info.noisy_electrodes, 3);
        uint32_t count = 0;
        for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
            const int left = crossed ? uses_either(ctx, i) : measures_across(ctx, i);
            CHECK_EQUAL(ctx->rows.unusable[i], left ? EITS_ROW_NOISY : 0);
            count += (uint32_t)left;
        }
        CHECK(count >= PAIR_FOLDS && ctx->info.masked == count);
    }
}

RUN_TESTS("unpaired", dense_bench_close(&b.on))

/* What is found wrong with a frame, and what is left out because of it; glitches in quiet frames. */
#include "check.h"
#include "small_model.h"

#include "examine.h"
#include "vec.h"

#include <math.h>
#include <string.h>

enum { QUIET = 16 };

typedef struct bench {
    small_model made;
    small_context c;
    eits_real quiet[QUIET][SMALL_ROWS], frame[SMALL_ROWS];
    uint64_t state;
} bench;

static void add_noise(bench *b, eits_real *frame)
{
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        frame[i] += (eits_real)(1e-3 * small_random(&b->state));
}

/* 8 electrodes: with 40 rows each electrode has 20 of them, each pair 5 or 6 that drive or measure across it. */
static eits_context *set_up(bench *b, int noise_known)
{
    b->made = small_model_make((small_spec){.rank = 12, .side = 4});
    small_context_open(&b->c, &b->made, 0);
    b->state = 7;
    small_reference(&b->c.model, 1, b->frame);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i) /* all rows of a like size, so that all are significant */
        b->frame[i] = b->frame[i] < 0 ? R(-1) : R(1);
    for (int k = 0; k < QUIET; ++k) {
        memcpy(b->quiet[k], b->frame, sizeof b->frame);
        add_noise(b, b->quiet[k]);
    }
    if (noise_known) {
        CHECK_EQUAL(eits_baseline_begin(&b->c.ctx, QUIET), EITS_OK);
        for (int k = 0; k < QUIET; ++k)
            CHECK_EQUAL(eits_baseline_add(&b->c.ctx, b->quiet[k], SMALL_ROWS), EITS_OK);
        CHECK_EQUAL(eits_baseline_finish(&b->c.ctx), EITS_OK);
    } else {
        CHECK_EQUAL(eits_baseline_set(&b->c.ctx, b->frame, SMALL_ROWS), EITS_OK);
    }
    add_noise(b, b->frame);
    return &b->c.ctx;
}

static void tear_down(bench *b)
{
    small_context_close(&b->c);
    small_model_free(&b->made);
}

static int row_uses(const eits_context *ctx, uint32_t i, uint32_t e)
{
    const uint8_t *row = eits_row(ctx, i);
    return row[0] == e || row[1] == e || row[2] == e || row[3] == e;
}

static int row_crosses(const eits_context *ctx, uint32_t i, uint32_t e, uint32_t f)
{
    const uint8_t *row = eits_row(ctx, i);
    return (row[0] == e && row[1] == f) || (row[0] == f && row[1] == e) || (row[2] == e && row[3] == f) ||
           (row[2] == f && row[3] == e);
}

static void look_for(eits_context *ctx, uint32_t findings)
{
    eits_options o = ctx->options;
    o.findings = findings;
    o.max_masked = SMALL_ROWS;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
}

static void reconstruct(bench *b)
{
    CHECK_EQUAL(eits_reconstruct(&b->c.ctx, b->frame, SMALL_ROWS, NULL, NULL), EITS_OK);
}

static void nothing_wrong(void)
{
    for (int known = 0; known < 2; ++known) {
        bench b;
        eits_context *ctx = set_up(&b, known);
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.findings, 0);
        CHECK_EQUAL(ctx->info.masked, 0);
        CHECK(ctx->baseline.glitches == 0 && (ctx->baseline.noise_v > 0) == known);
        tear_down(&b);
    }
}

/* Zero, NaN or saturated: all rows of an electrode tell that it is open, and are left out; one that lives, and it is not. */
static void open_electrodes(void)
{
    for (int kind = 0; kind < 3; ++kind) {
        for (uint32_t e = 0; e < SMALL_ELECTRODES; ++e) {
            bench b;
            eits_context *ctx = set_up(&b, 1);
            look_for(ctx, EITS_FINDINGS_ALL);
            eits_options o = ctx->options;
            o.saturation_v = 2;
            CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
            uint32_t count = 0, last = 0;
            for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
                if (!row_uses(ctx, i, e))
                    continue;
                b.frame[i] = kind == 0 ? 0 : (kind == 1 ? R(NAN) : R(-2.5));
                ++count;
                last = i;
            }
            reconstruct(&b);
            CHECK_EQUAL(ctx->info.masked, count);
            CHECK_EQUAL(ctx->info.open_electrodes, 1u << e);
            CHECK_EQUAL(ctx->info.findings & (EITS_FINDING_ELECTRODE_OPEN | EITS_FINDING_BRIDGED), EITS_FINDING_ELECTRODE_OPEN);
            CHECK_EQUAL(ctx->info.saturated, kind == 2 ? count : 0);
            CHECK((ctx->info.findings & EITS_FINDING_SATURATED) != 0 || kind != 2);
            for (uint32_t k = 0; k < SMALL_ELECTRODES; ++k)
                CHECK_EQUAL(ctx->electrode[k], k == e ? EITS_ELECTRODE_OPEN : 0);
            for (uint32_t i = 0; i < SMALL_ROWS; ++i)
                CHECK((ctx->unusable[i] & EITS_ROW_OPEN) != 0 || !row_uses(ctx, i, e));
            const eits_real dead = b.frame[last];
            b.frame[last] = ctx->baseline.v0[last];
            reconstruct(&b);
            CHECK_EQUAL(ctx->info.open_electrodes, 0);
            b.frame[last] = dead;
            look_for(ctx, EITS_FINDINGS_ALL & ~(uint32_t)EITS_FINDING_ELECTRODE_OPEN);
            reconstruct(&b);
            CHECK_EQUAL(ctx->info.open_electrodes, 0);
            tear_down(&b);
        }
    }
}

/* Nothing on any row is no matter of electrodes. */
static void all_dead(void)
{
    bench b;
    eits_context *ctx = set_up(&b, 1);
    memset(b.frame, 0, sizeof b.frame);
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ZERO);
    CHECK_EQUAL(ctx->info.findings, 0);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = R(NAN);
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_CHANNELS);
    CHECK_EQUAL(ctx->info.findings, 0);
    tear_down(&b);
}

/* Nor is nothing but noise: a dead front end, which blames no electrode. */
static void noise_alone(void)
{
    for (int open = 0; open < 2; ++open) {
        bench b;
        eits_context *ctx = set_up(&b, 1);
        look_for(ctx, open ? EITS_FINDINGS_ALL : EITS_FINDINGS_ALL & ~(uint32_t)EITS_FINDING_ELECTRODE_OPEN);
        memset(b.frame, 0, sizeof b.frame);
        add_noise(&b, b.frame);
        CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ZERO);
        CHECK(ctx->info.findings == 0 && ctx->info.open_electrodes == 0);
        b.frame[7] = ctx->baseline.v0[7]; /* one row that lives, and it is not the front end */
        CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_OK);
        CHECK_EQUAL(ctx->info.findings & EITS_FINDING_ELECTRODE_OPEN, open ? EITS_FINDING_ELECTRODE_OPEN : 0);
        tear_down(&b);
    }
}

/* Dead below 2 % of the reference or 5 times the noise; a row whose reference is small tells nothing either way. */
static void what_a_dead_row_is(void)
{
    for (int way = 0; way < 6; ++way) {
        bench b;
        eits_context *ctx = set_up(&b, 0);
        const eits_real share = way < 2 ? (way ? R(0.025) : R(0.015)) : 0, small = way == 4 ? R(0.4) : R(0.2);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] = (row_uses(ctx, i, 2) && row_uses(ctx, i, 6) && way >= 4 ? small : R(1)) * (b.frame[i] < 0 ? R(-1) : R(1));
        CHECK_EQUAL(eits_baseline_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
        look_for(ctx, EITS_FINDING_ELECTRODE_OPEN);
        ctx->baseline.noise_v = way == 2 || way == 3 ? R(0.006) : 0; /* as though it had been learned */
        for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
            if (row_uses(ctx, i, 6) && (way < 4 || !row_uses(ctx, i, 2)))
                b.frame[i] = way == 2 || way == 3 ? (way == 2 ? R(0.028) : R(0.033)) * b.frame[i] : share * b.frame[i];
        }
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.open_electrodes, way == 1 || way == 3 || way == 4 ? 0 : 1u << 6);
        tear_down(&b);
    }
}

/* Refused, and still named. */
static void refused_by_name(void)
{
    bench b;
    eits_context *ctx = set_up(&b, 1);
    eits_options o = ctx->options;
    o.max_masked = 10;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = row_uses(ctx, i, 3) ? 0 : b.frame[i];
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_CHANNELS);
    CHECK_EQUAL(ctx->info.findings, EITS_FINDING_ELECTRODE_OPEN);
    CHECK_EQUAL(ctx->info.open_electrodes, 1u << 3);
    tear_down(&b);
}

static void bridged_pairs(void)
{
    for (uint32_t e = 0; e < SMALL_ELECTRODES; ++e) {
        bench b;
        eits_context *ctx = set_up(&b, 1);
        const uint32_t f = (e + 1) % SMALL_ELECTRODES;
        look_for(ctx, EITS_FINDINGS_ALL);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] *= row_crosses(ctx, i, e, f) ? R(0.01) : R(1);
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.findings, EITS_FINDING_BRIDGED);
        CHECK_EQUAL(ctx->info.bridged_electrodes, (1u << e) | (1u << f));
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            CHECK_EQUAL(ctx->unusable[i], row_uses(ctx, i, e) || row_uses(ctx, i, f) ? EITS_ROW_BRIDGED : 0);
        look_for(ctx, EITS_FINDINGS_ALL & ~(uint32_t)EITS_FINDING_BRIDGED);
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.bridged_electrodes, 0);
        tear_down(&b);
    }
}

/* The small model's P is arbitrary: nothing predicts, so both sides of a fold go; the noise is known or told by all folds. */
static void one_glitch(void)
{
    for (int known = 0; known < 2; ++known) {
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
            bench b;
            eits_context *ctx = set_up(&b, known);
            const eits_fold fold = b.c.model.fold[k];
            CHECK(!ctx->sheet_known);
            b.frame[fold.first] *= R(1.3);
            reconstruct(&b);
            if (fold.second == EITS_FOLD_NONE) {
                CHECK_EQUAL(ctx->info.glitches, 0);
            } else {
                CHECK_EQUAL(ctx->info.findings, EITS_FINDING_GLITCH);
                CHECK_EQUAL(ctx->info.glitches, 2);
                CHECK_EQUAL(ctx->info.masked, 2);
                CHECK(ctx->unusable[fold.first] == EITS_ROW_GLITCH && ctx->unusable[fold.second] == EITS_ROW_GLITCH);
            }
            look_for(ctx, EITS_FINDINGS_ALL & ~(uint32_t)EITS_FINDING_GLITCH);
            reconstruct(&b);
            CHECK_EQUAL(ctx->info.masked, 0);
            tear_down(&b);
        }
    }
}

/* A sign that turned, and a row that grew eightfold, are no touch's doing; three turned ones are another order of the channels. */
static void impossible_rows(void)
{
    bench b;
    eits_context *ctx = set_up(&b, 1);
    const eits_real good = b.frame[9];
    b.frame[9] *= -1;
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.findings, EITS_FINDING_GLITCH);
    CHECK_EQUAL(ctx->unusable[9], EITS_ROW_GLITCH);
    CHECK_EQUAL(ctx->info.masked, 1);
    b.frame[9] = 9 * good;
    reconstruct(&b);
    CHECK_EQUAL(ctx->unusable[9], EITS_ROW_GLITCH);
    CHECK_EQUAL(ctx->info.masked, 1);
    b.frame[9] = good;
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] *= R(-1);
    reconstruct(&b);
    CHECK((ctx->info.findings & EITS_FINDING_MISFIT) != 0);
    CHECK_EQUAL(ctx->info.masked, 0);
    tear_down(&b);
}

/* Many folds whose sides disagree: those that share an electrode leave with it; those that share none are no network's. */
static void many_glitches(void)
{
    bench b;
    eits_context *ctx = set_up(&b, 1);
    look_for(ctx, EITS_FINDINGS_ALL);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const uint32_t i = b.c.model.fold[k].first;
        b.frame[i] *= row_uses(ctx, i, 5) ? R(1.2) : R(1);
    }
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.findings, EITS_FINDING_ELECTRODE_NOISY);
    CHECK_EQUAL(ctx->info.noisy_electrodes, 1u << 5);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        CHECK_EQUAL(ctx->unusable[i], row_uses(ctx, i, 5) ? EITS_ROW_NOISY : 0);
    look_for(ctx, EITS_FINDINGS_ALL & ~(uint32_t)EITS_FINDING_ELECTRODE_NOISY);
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.masked, 0);
    memcpy(b.frame, b.quiet[0], sizeof b.frame);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
        b.frame[b.c.model.fold[k].first] *= k % 2 == 0 ? R(1.2) : R(0.9);
    look_for(ctx, EITS_FINDINGS_ALL);
    reconstruct(&b);
    CHECK((ctx->info.findings & EITS_FINDING_MISFIT) != 0 && ctx->info.masked == 0);
    tear_down(&b);
}

/* One reading of any of the quiet frames: left out, and the reference is as without it. */
static void quiet_glitch(void)
{
    for (int at = 0; at < QUIET; ++at) {
        bench b;
        eits_context *ctx = set_up(&b, 1);
        const eits_real noise = ctx->baseline.noise_v, lambda_noise = ctx->baseline.lambda_noise;
        const uint32_t row = at % 3 ? b.c.model.fold[at].second : b.c.model.fold[at].first;
        b.quiet[at][row] += R(0.5);
        CHECK_EQUAL(eits_baseline_begin(ctx, QUIET), EITS_OK);
        for (int k = 0; k < QUIET; ++k) {
            CHECK_EQUAL(eits_baseline_add(ctx, b.quiet[k], SMALL_ROWS), EITS_OK);
            CHECK_EQUAL(ctx->baseline.count, k + 1);
        }
        CHECK_EQUAL(eits_baseline_finish(ctx), EITS_OK);
        CHECK_EQUAL(ctx->baseline.glitches, 1);
        CHECK_NEAR(eits_fabs(ctx->baseline.v0[row]), 1, 2e-3);
        CHECK_NEAR(ctx->baseline.noise_v, noise, 0.05 * (double)noise);
        CHECK_NEAR(ctx->baseline.lambda_noise, lambda_noise, 0.3 * (double)lambda_noise);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            CHECK_EQUAL(ctx->bad[i], 0);
        look_for(ctx, 0);
        CHECK_EQUAL(eits_baseline_begin(ctx, QUIET), EITS_OK);
        for (int k = 0; k < QUIET; ++k)
            CHECK_EQUAL(eits_baseline_add(ctx, b.quiet[k], SMALL_ROWS), EITS_OK);
        CHECK_EQUAL(eits_baseline_finish(ctx), EITS_OK);
        CHECK(ctx->baseline.glitches == 0 && ctx->baseline.noise_v > 5 * noise);
        tear_down(&b);
    }
}

/* More readings of a quiet frame than glitches are: it counts as it is. */
static void quiet_frame_of_another_kind(void)
{
    bench b;
    eits_context *ctx = set_up(&b, 1);
    for (uint32_t count = 1; count <= EITS_GLITCH_MOST + 1; ++count) {
        b.quiet[5][b.c.model.fold[count].first] += R(0.5);
        CHECK_EQUAL(eits_baseline_begin(ctx, QUIET), EITS_OK);
        for (int k = 0; k < QUIET; ++k)
            CHECK_EQUAL(eits_baseline_add(ctx, b.quiet[k], SMALL_ROWS), EITS_OK);
        CHECK_EQUAL(eits_baseline_finish(ctx), EITS_OK);
        CHECK_EQUAL(ctx->baseline.glitches, count <= EITS_GLITCH_MOST ? count : 0);
        CHECK((ctx->baseline.noise_v < R(2e-3)) == (count <= EITS_GLITCH_MOST));
    }
    tear_down(&b);
}

static void medians(void)
{
    uint64_t state = 5;
    for (uint32_t n = 1; n < 40; ++n) {
        eits_real v[40], sorted[40];
        for (uint32_t k = 0; k < n; ++k)
            sorted[k] = (eits_real)((int)(5 * small_random(&state)));
        for (uint32_t k = 0; k < n; ++k) {
            memcpy(v, sorted, sizeof v);
            const eits_real found = eits_kth(v, n, k);
            uint32_t below = 0, up_to = 0;
            for (uint32_t l = 0; l < n; ++l) {
                below += sorted[l] < found;
                up_to += sorted[l] <= found;
            }
            CHECK(below <= k && k < up_to);
        }
    }
}

static void options_and_names(void)
{
    bench b;
    eits_context *ctx = set_up(&b, 0);
    eits_options o = ctx->options;
    CHECK_EQUAL(o.findings, EITS_FINDINGS_ALL);
    o.findings = EITS_FINDINGS_ALL + 1;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_E_ARGUMENT);
    uint32_t all = 0;
    for (uint32_t bit = 1; bit <= EITS_FINDINGS_ALL; bit <<= 1) {
        CHECK(strcmp(eits_finding_text((eits_finding)bit), "unknown finding") != 0);
        all |= bit;
    }
    CHECK_EQUAL(all, EITS_FINDINGS_ALL);
    CHECK(strcmp(eits_finding_text((eits_finding)0), "unknown finding") == 0);
    tear_down(&b);
}

int main(void)
{
    nothing_wrong();
    open_electrodes();
    all_dead();
    noise_alone();
    what_a_dead_row_is();
    refused_by_name();
    bridged_pairs();
    one_glitch();
    impossible_rows();
    many_glitches();
    quiet_glitch();
    quiet_frame_of_another_kind();
    medians();
    options_and_names();
    return checks_report("findings");
}

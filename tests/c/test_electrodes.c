/* Open electrodes, bridged pairs, dead front ends, and rows that the model cannot give. */
#include "spoiled_frame.h"

static const struct dead {
    const char *name;
    double value;
    int saturated;
} DEAD[] = {{"zero", 0, 0}, {"no number", NAN, 0}, {"saturated", -2.5, 1}};

/* All rows of electrode e read as `dead`: it is open, and they are left out. */
static void check_open(const struct dead *dead, uint32_t e)
{
    eits_context *ctx = set_up(&b, 1);
    const int zero = dead->value == 0;
    look_for(ctx, EITS_DIAGNOSTICS_ALL);
    CHANGE_OPTIONS(ctx, o.saturation_v = 2);
    uint32_t count = 0, last = 0;
    for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
        if (!row_uses(ctx, i, e))
            continue;
        b.frame[i] = (eits_real)dead->value;
        ++count;
        last = !zero || row_drives(ctx, i, e) ? i : last;
    }
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.masked, count);
    CHECK_EQUAL(ctx->info.open_electrodes, 1u << e);
    CHECK_EQUAL(ctx->info.diagnostics & (EITS_DIAGNOSTIC_ELECTRODE_OPEN | EITS_DIAGNOSTIC_BRIDGED),
                EITS_DIAGNOSTIC_ELECTRODE_OPEN);
    CHECK_EQUAL(ctx->info.saturated, dead->saturated ? count : 0);
    CHECK((ctx->info.diagnostics & EITS_DIAGNOSTIC_SATURATED) != 0 || !dead->saturated);
    for (uint32_t k = 0; k < SMALL_ELECTRODES; ++k)
        CHECK_EQUAL(ctx->rows.electrode[k], k == e ? EITS_ELECTRODE_OPEN : 0);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        CHECK((ctx->rows.unusable[i] & EITS_ROW_OPEN) != 0 || !row_uses(ctx, i, e));
    CHECK_EQUAL(ctx->rows.unusable[SMALL_ROWS], 0); /* no row */
    /* one row that lives, and the electrode is not open: where they are zero, one that it drives */
    const eits_real kept = b.frame[last];
    b.frame[last] = ctx->reference.v0[last];
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.open_electrodes, 0);
    CHECK_EQUAL(ctx->rows.electrode[e] & EITS_ELECTRODE_OPEN, 0);
    b.frame[last] = kept;
    look_for(ctx, EITS_DIAGNOSTICS_ALL & ~(uint32_t)EITS_DIAGNOSTIC_ELECTRODE_OPEN);
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.open_electrodes, 0);
}

TEST(open_electrodes_are_named_and_left_out)
{
    EACH_ROW(dead, DEAD) {
        for (uint32_t e = 0; e < SMALL_ELECTRODES; ++e)
            check_open(dead, e);
    }
}

/* No current passes through the electrode, and it floats when it is measured, at voltages near the
 * reference, so that reciprocals do not show it. It is named open nevertheless. Rows without a
 * number do not count as rows without current. */
TEST(an_open_electrode_that_floats)
{
    for (int missing = 0; missing < 2; ++missing) {
        for (uint32_t e = 0; e < SMALL_ELECTRODES; ++e) {
            eits_context *ctx = set_up(&b, 1);
            look_for(ctx, EITS_DIAGNOSTIC_ELECTRODE_OPEN);
            for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
                if (row_drives(ctx, i, e))
                    b.frame[i] = missing ? R(NAN) : 0;
                else if (row_uses(ctx, i, e))
                    b.frame[i] *= R(0.5);
            }
            reconstruct(&b);
            CHECK_EQUAL(ctx->info.open_electrodes, missing ? 0 : 1u << e);
        }
    }
}

/* If all rows are dead, the front end is dead, and no electrode is named. */
TEST(all_dead_is_a_dead_front_end)
{
    eits_context *ctx = set_up(&b, 1);
    memset(b.frame, 0, sizeof b.frame);
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ZERO);
    CHECK_EQUAL(ctx->info.diagnostics, 0);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = R(NAN);
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ROWS);
    CHECK_EQUAL(ctx->info.diagnostics, 0);
}

/* Nor is nothing but noise: a dead front end, which blames no electrode. */
TEST(noise_alone)
{
    for (int open = 0; open < 2; ++open) {
        eits_context *ctx = set_up(&b, 1);
        look_for(ctx, open ? EITS_DIAGNOSTICS_ALL
                           : EITS_DIAGNOSTICS_ALL & ~(uint32_t)EITS_DIAGNOSTIC_ELECTRODE_OPEN);
        memset(b.frame, 0, sizeof b.frame);
        add_noise(&b, b.frame);
        CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ZERO);
        CHECK(ctx->info.diagnostics == 0 && ctx->info.open_electrodes == 0);
        b.frame[7] = ctx->reference.v0[7]; /* one row that lives, and it is not the front end */
        CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
        CHECK_EQUAL(ctx->info.diagnostics & EITS_DIAGNOSTIC_ELECTRODE_OPEN,
                    open ? EITS_DIAGNOSTIC_ELECTRODE_OPEN : 0);
    }
}

/* A row is dead below 2 % of its reference or below 5 times the noise; a row whose reference is
 * small counts neither as dead nor as alive. Electrode 6 has the dead rows. The rows that it
 * shares with electrode 2 have the reference `shared`, all others have 1; if `shared` is small,
 * these rows stay as they are. */
TEST(what_a_dead_row_is)
{
    static const struct {
        const char *name;
        double fraction; /* of the reference that is left on the rows of electrode 6 */
        double noise_v;
        double shared;
        int open;
    } rows[] = {
        {"1.5 % is dead", 0.015, 0, 1, 1},
        {"2.5 % is not", 0.025, 0, 1, 0},
        {"2.8 % at 0.6 % noise is dead", 0.028, 0.006, 1, 1},
        {"3.3 % at 0.6 % noise is not", 0.033, 0.006, 1, 0},
        {"rows that live, of 0.4, count", 0, 0, 0.4, 0},
        {"rows that live, of 0.2, do not", 0, 0, 0.2, 1},
    };
    EACH_ROW(row, rows) {
        eits_context *ctx = set_up(&b, 0);
        const int small = row->shared < 1;
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] = (eits_real)(row_uses(ctx, i, 2) && row_uses(ctx, i, 6) ? row->shared : 1) *
                         (b.frame[i] < 0 ? R(-1) : R(1));
        CHECK_OK(eits_reference_set(ctx, b.frame, SMALL_ROWS));
        look_for(ctx, EITS_DIAGNOSTIC_ELECTRODE_OPEN);
        ctx->reference.noise_v = (eits_real)row->noise_v; /* as though it had been learned */
        for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
            if (row_uses(ctx, i, 6) && !(small && row_uses(ctx, i, 2)))
                b.frame[i] *= (eits_real)row->fraction;
        }
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.open_electrodes, row->open ? 1u << 6 : 0);
    }
}

/* Refused, and still named. */
TEST(refused_by_name)
{
    eits_context *ctx = set_up(&b, 1);
    CHANGE_OPTIONS(ctx, o.max_masked = 10);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = row_uses(ctx, i, 3) ? 0 : b.frame[i];
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ROWS);
    CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_ELECTRODE_OPEN);
    CHECK_EQUAL(ctx->info.open_electrodes, 1u << 3);
}

TEST(bridged_pairs_are_named_and_left_out)
{
    for (uint32_t e = 0; e < SMALL_ELECTRODES; ++e) {
        eits_context *ctx = set_up(&b, 1);
        const uint32_t f = (e + 1) % SMALL_ELECTRODES;
        look_for(ctx, EITS_DIAGNOSTICS_ALL);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] *= row_crosses(ctx, i, e, f) ? R(0.01) : R(1);
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_BRIDGED);
        CHECK_EQUAL(ctx->info.bridged_electrodes, (1u << e) | (1u << f));
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            CHECK_EQUAL(ctx->rows.unusable[i],
                        row_uses(ctx, i, e) || row_uses(ctx, i, f) ? EITS_ROW_BRIDGED : 0);
        look_for(ctx, EITS_DIAGNOSTICS_ALL & ~(uint32_t)EITS_DIAGNOSTIC_BRIDGED);
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.bridged_electrodes, 0);
    }
}

/* One row across the pair that lives, whichever, and there is no bridge. */
TEST(living_pairs_are_not_bridged)
{
    for (uint32_t e = 0; e < SMALL_ELECTRODES; ++e) {
        eits_context *ctx = set_up(&b, 1);
        const uint32_t f = (e + 1) % SMALL_ELECTRODES;
        look_for(ctx, EITS_DIAGNOSTIC_BRIDGED);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] *= row_crosses(ctx, i, e, f) ? R(0.01) : R(1);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
            const eits_real dead = b.frame[i];
            if (!row_crosses(ctx, i, e, f))
                continue;
            b.frame[i] *= 100;
            reconstruct(&b);
            CHECK_EQUAL(ctx->info.diagnostics, 0);
            b.frame[i] = dead;
        }
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_BRIDGED);
        uint32_t telling = 0; /* two rows that tell something are too few */
        memcpy(b.frame, b.untouched[0], sizeof b.frame);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.frame[i] *= row_crosses(ctx, i, e, f) && ++telling > 2 ? R(0.1) : R(1);
        CHECK_OK(eits_reference_set(ctx, b.frame, SMALL_ROWS));
        for (uint32_t i = 0, more = 0; i < SMALL_ROWS; ++i) {
            const int another = !row_crosses(ctx, i, e, f) && more++ == 0;
            b.frame[i] *= row_crosses(ctx, i, e, f) || another ? 0 : R(1);
        }
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.diagnostics, 0);
    }
}

/* Rows that the user masked are no sign of an open electrode, nor saturated; and a frame's
 * diagnostics end with it. */
TEST(masked_and_forgotten)
{
    eits_context *ctx = set_up(&b, 1);
    look_for(ctx, EITS_DIAGNOSTICS_ALL);
    CHANGE_OPTIONS(ctx, o.saturation_v = 2);
    const eits_real good = b.frame[9];
    b.frame[9] *= -1;
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_OUTLIER);
    b.frame[9] = good;
    reconstruct(&b);
    CHECK(ctx->info.diagnostics == 0 && ctx->info.outliers == 0 && ctx->info.masked == 0);
    for (int turned = 1; turned >= 0; --turned) { /* the stage by itself */
        uint32_t masked;
        uint64_t macs;
        b.frame[9] = turned ? -good : good;
        CHECK_OK(eits_frame_stage(ctx, b.frame, SMALL_ROWS, &masked, &macs));
        CHECK_EQUAL(ctx->info.diagnostics, turned ? EITS_DIAGNOSTIC_OUTLIER : 0);
        CHECK_EQUAL(ctx->info.outliers, turned);
    }
    for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
        if (!row_uses(ctx, i, 3))
            continue;
        CHECK_OK(eits_mask_row(ctx, i, 1));
        b.frame[i] = i % 2 ? 3 : 0;
    }
    reconstruct(&b);
    CHECK(ctx->info.diagnostics == 0 && ctx->info.saturated == 0 && ctx->info.masked == 20);
}

/* A row whose reference is next to nothing has not grown before it is eight times 5 % of the rms.
 */
TEST(small_rows)
{
    eits_context *ctx = set_up(&b, 0);
    const eits_fold fold = b.on.c.model.fold[4];
    b.frame[fold.first] = R(0.01), b.frame[fold.second] = (eits_real)fold.sign * R(0.01);
    CHECK_OK(eits_reference_set(ctx, b.frame, SMALL_ROWS));
    for (int grown = 0; grown < 2; ++grown) {
        b.frame[fold.first] = grown ? R(0.42) : R(0.36),
        b.frame[fold.second] = (eits_real)fold.sign * b.frame[fold.first];
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.diagnostics, grown ? EITS_DIAGNOSTIC_OUTLIER : 0);
        CHECK_EQUAL(ctx->info.masked, grown ? 2 : 0);
    }
}

/* A sign that turned, and a row that grew eightfold, are no touch's doing; three turned ones are
 * another order of the channels. */
TEST(impossible_rows)
{
    eits_context *ctx = set_up(&b, 1);
    const eits_real good = b.frame[9];
    b.frame[9] *= -1;
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_OUTLIER);
    CHECK_EQUAL(ctx->rows.unusable[9], EITS_ROW_OUTLIER);
    CHECK_EQUAL(ctx->info.masked, 1);
    b.frame[9] = 9 * good;
    reconstruct(&b);
    CHECK_EQUAL(ctx->rows.unusable[9], EITS_ROW_OUTLIER);
    CHECK_EQUAL(ctx->info.masked, 1);
    b.frame[9] = good;
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] *= R(-1);
    reconstruct(&b);
    CHECK((ctx->info.diagnostics & EITS_DIAGNOSTIC_MODEL_MISMATCH) != 0);
    CHECK_EQUAL(ctx->info.masked, 0);
}

RUN_TESTS("electrodes", dense_bench_close(&b.on))

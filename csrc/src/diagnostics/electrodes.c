/* Open electrodes and bridged pairs, found by rows that are dead.
 *
 * A detached electrode or a bridge spoils every row that uses it, by far more than a touch does,
 * and would show as a false touch. docs/reference/diagnostics.md has the rules, and
 * studies/results/diagnostics.md what they cost and how often they fail.
 *
 * Method: each row that has a clear reference is alive, dead (almost no voltage) or turned (the
 * other sign, which no change of conductivity can cause). An electrode is open if none of its rows
 * is alive. A pair is bridged if both electrodes are alive in other rows, but no row across the
 * pair is. Three rows have to agree (EITS_ROWS_TO_JUDGE), since two may fail together for other
 * reasons.
 *
 * In: the frame's voltages, the reference with its noise, and in rows.unusable the faults that each
 * row shows by itself. Out: rows.electrode, rows.unusable, info. The cost is a few comparisons per
 * row and electrode. Rows are judged again whenever they are needed, which saves the memory to
 * store it. */
#include "diagnostics/diagnostics.h"

#include "base/vec.h"

enum { DEAD = 1, ALIVE = 2, TURNED = 4 }; /* 0: a row that allows no conclusion */

typedef struct limits {
    eits_real significant, noise;
} limits;

/* A row is compared with the noise as well as with the reference: a row whose reference is smaller
 * than the noise is neither dead nor alive. A significant row must exceed the limit of a dead row
 * many times, so that its noise never makes it look dead. */
static limits limits_of(const eits_context *ctx)
{
    const eits_real fraction = EITS_ROW_SIGNIFICANT * ctx->reference.v0_rms,
                    noise = EITS_ROW_DEAD_NOISE * ctx->reference.noise_v;
    return (limits){fraction > EITS_ROW_SIGNIFICANT_NOISE * noise
                        ? fraction
                        : EITS_ROW_SIGNIFICANT_NOISE * noise,
                    noise};
}

/* Only rows with a clear reference allow a conclusion: a row that is small by geometry is also
 * small with an open electrode. A dead row lacks the signal that it should have: it is not a
 * number, saturated, or near zero. */
static int judge_row(const eits_context *ctx, const eits_real *frame, limits lim, uint32_t i)
{
    const eits_real v0 = ctx->reference.v0[i], size = eits_fabs(v0);
    if (!(size >= lim.significant) || (ctx->rows.unusable[i] & EITS_ROW_MASKED) != 0)
        return 0;
    if (ctx->rows.unusable[i] != 0)
        return DEAD;
    const eits_real fraction = EITS_ROW_DEAD_FRACTION * size,
                    limit = fraction > lim.noise ? fraction : lim.noise;
    const eits_real along = v0 < 0 ? -frame[i] : frame[i];
    if (along >= limit)
        return ALIVE;
    return along > -limit ? DEAD : ALIVE | TURNED;
}

/* Return 1 if the row is far larger than any touch can make it, even if its reference is small.
 *
 * A touch lowers or raises a row by a fraction of itself; a floating input or a broken amplifier
 * gives many times as much. The reference counts as at least a fraction of the rms of all
 * references, because a row near zero may grow by any factor. */
static int is_grown(const eits_context *ctx, const eits_real *frame, limits lim, uint32_t i)
{
    const eits_real v0 = eits_fabs(ctx->reference.v0[i]),
                    min = EITS_ROW_SMALL * ctx->reference.v0_rms;
    return ctx->rows.unusable[i] == 0 &&
           eits_fabs(frame[i]) > eits_fma(EITS_ROW_GROWN, v0 > min ? v0 : min, lim.noise);
}

/* Return 1 if row i uses an electrode in this state. */
static int uses(const eits_context *ctx, uint32_t i, eits_electrode_state state)
{
    const uint8_t *row = eits_row(ctx, i);
    const unsigned any = ctx->rows.electrode[row[0]] | ctx->rows.electrode[row[1]] |
                         ctx->rows.electrode[row[2]] | ctx->rows.electrode[row[3]];
    return (any & (unsigned)state) != 0;
}

/* Counts for each electrode, up to EITS_ROWS_TO_JUDGE: `rows`, how many rows allow a conclusion
 * about it; `silent`, how many of those that drive with it are dead, or FLOWS if one of them is
 * not. */
typedef struct evidence {
    uint8_t rows[EITS_MAX_ELECTRODES], silent[EITS_MAX_ELECTRODES];
} evidence;

enum { FLOWS = UINT8_MAX };

static void count_row(evidence *of, uint8_t *alive, const uint8_t *row, int state, int usable)
{
    for (uint32_t k = 0; k < 4; ++k) {
        const uint8_t e = row[k];
        of->rows[e] = (uint8_t)(of->rows[e] + (of->rows[e] < EITS_ROWS_TO_JUDGE));
        alive[e] |= (state & ALIVE) != 0;
    }
    for (uint32_t k = 0; k < 2; ++k) {
        uint8_t *silent = &of->silent[row[k]];
        if (state != DEAD || !usable)
            *silent = FLOWS;
        else
            *silent = (uint8_t)(*silent + (*silent < EITS_ROWS_TO_JUDGE));
    }
}

/* Return 1 if electrode e drives with several others, in rows that allow a conclusion. With only
 * one partner, a bridge between the two would stop its current as well. */
static int has_partners(const eits_context *ctx, const eits_real *frame, limits lim, uint32_t e)
{
    uint32_t partner = EITS_MAX_ELECTRODES;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const uint8_t *row = eits_row(ctx, i);
        if ((row[0] != e && row[1] != e) || judge_row(ctx, frame, lim, i) == 0)
            continue;
        const uint32_t other = row[0] == e ? row[1] : row[0];
        if (partner != EITS_MAX_ELECTRODES && other != partner)
            return 1;
        partner = other;
    }
    return 0;
}

/* Find the open electrodes. An electrode is open if all its significant rows are dead; or if no
 * current flows through it with any partner, and it floats where it is measured. A row that is
 * saturated or not a number shows nothing about a current. Returns 0 if all electrodes seem open,
 * since then the fault is elsewhere. `alive` gets 1 for each electrode that has a row which is
 * alive. */
static int find_open(eits_context *ctx, const eits_real *frame, limits lim, uint8_t *alive)
{
    evidence of;
    memset(&of, 0, sizeof of);
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const int state = judge_row(ctx, frame, lim, i);
        if (state != 0)
            count_row(&of, alive, eits_row(ctx, i), state, ctx->rows.unusable[i] == 0);
    }
    uint8_t *is_open = of.silent;
    uint32_t judged = 0, open = 0;
    for (uint32_t e = 0; e < ctx->model->n_electrodes; ++e) {
        judged += of.rows[e] >= EITS_ROWS_TO_JUDGE;
        is_open[e] = (of.rows[e] >= EITS_ROWS_TO_JUDGE && !alive[e]) ||
                     (of.silent[e] == EITS_ROWS_TO_JUDGE && has_partners(ctx, frame, lim, e));
        open += is_open[e];
    }
    /* If all electrodes are open at once, a plug is out or a supply has failed. */
    if (open == judged)
        return 0;
    if (open == 0 || !eits_wants(ctx, EITS_DIAGNOSTIC_ELECTRODE_OPEN))
        return 1;
    for (uint32_t e = 0; e < ctx->model->n_electrodes; ++e) {
        if (is_open[e])
            ctx->rows.electrode[e] |= EITS_ELECTRODE_OPEN;
    }
    ctx->info.diagnostics |= EITS_DIAGNOSTIC_ELECTRODE_OPEN;
    return 1;
}

/* The polarity does not matter for a bridge or a channel. */
int eits_is_pair(const uint8_t *two, uint32_t e, uint32_t f)
{
    return (two[0] == e && two[1] == f) || (two[0] == f && two[1] == e);
}

/* Return 1 if all significant rows that drive or measure across (e, f), and use no open electrode,
 * are dead, and if there are enough of them.
 *
 * A bridge puts both electrodes on one potential: rows that drive across it drive no current
 * through the skin, rows that measure across it measure no voltage, and all other rows still work.
 * Rows through an open electrode are dead in any case and prove nothing. */
static int pair_is_dead(const eits_context *ctx, const eits_real *frame, limits lim, uint8_t e,
                        uint8_t f)
{
    uint32_t dead = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const uint8_t *row = eits_row(ctx, i);
        if ((!eits_is_pair(row, e, f) && !eits_is_pair(row + 2, e, f)) ||
            uses(ctx, i, EITS_ELECTRODE_OPEN))
            continue;
        const int state = judge_row(ctx, frame, lim, i);
        /* If one row across the pair is alive, there is a voltage across it, so there is no bridge.
         */
        if ((state & ALIVE) != 0)
            return 0;
        dead += state == DEAD;
    }
    return dead >= EITS_ROWS_TO_JUDGE;
}

/* Find bridged pairs: both electrodes are alive in rows that use only one of them.
 *
 * The search starts from dead rows, because they are few, and not from all pairs. */
static void find_bridged(eits_context *ctx, const eits_real *frame, limits lim,
                         const uint8_t *alive)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (judge_row(ctx, frame, lim, i) != DEAD || uses(ctx, i, EITS_ELECTRODE_OPEN))
            continue;
        for (uint32_t k = 0; k < 4; k += 2) {
            const uint8_t e = eits_row(ctx, i)[k], f = eits_row(ctx, i)[k + 1];
            const unsigned known =
                ctx->rows.electrode[e] & ctx->rows.electrode[f] & EITS_ELECTRODE_BRIDGED;
            if (known != 0 || !alive[e] || !alive[f] || !pair_is_dead(ctx, frame, lim, e, f))
                continue;
            ctx->rows.electrode[e] |= EITS_ELECTRODE_BRIDGED;
            ctx->rows.electrode[f] |= EITS_ELECTRODE_BRIDGED;
            ctx->info.diagnostics |= EITS_DIAGNOSTIC_BRIDGED;
        }
    }
}

/* 64 bits name the first 64 electrodes; rows.electrode has the states of all. A frame begins
 * without named electrodes, and a name is not withdrawn. */
void eits_name_electrodes(eits_context *ctx)
{
    eits_info *info = &ctx->info;
    for (uint32_t e = 0; e < ctx->model->n_electrodes && e < 64; ++e) {
        const uint64_t bit = (uint64_t)1 << e;
        info->open_electrodes |= (ctx->rows.electrode[e] & EITS_ELECTRODE_OPEN) != 0 ? bit : 0;
        info->bridged_electrodes |=
            (ctx->rows.electrode[e] & EITS_ELECTRODE_BRIDGED) != 0 ? bit : 0;
        info->noisy_electrodes |= (ctx->rows.electrode[e] & EITS_ELECTRODE_NOISY) != 0 ? bit : 0;
    }
}

/* A row is left out if any of its four electrodes is in this state. */
void eits_leave_electrodes(eits_context *ctx, eits_electrode_state state, eits_row_state why)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (uses(ctx, i, state))
            ctx->rows.unusable[i] |= (uint8_t)why;
    }
}

void eits_leave_outlier(eits_context *ctx, uint32_t i)
{
    ctx->rows.unusable[i] |= EITS_ROW_OUTLIER;
    ++ctx->info.outliers;
    ctx->info.diagnostics |= EITS_DIAGNOSTIC_OUTLIER;
}

/* Leave out rows with values that the model cannot give, if they are few. More of them are a
 * mismatch. */
static void leave_impossible(eits_context *ctx, const eits_real *frame, limits lim)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if ((judge_row(ctx, frame, lim, i) & TURNED) != 0 || is_grown(ctx, frame, lim, i))
            eits_leave_outlier(ctx, i);
    }
}

/* There are three stages, the cheapest first, because a frame without a fault ends at the first:
 * count rows by state, look for open electrodes, look for bridges among the remaining rows. Open
 * electrodes come before bridges, because their dead rows would look like a bridge as well. */
int eits_find_electrodes(eits_context *ctx, const eits_real *frame)
{
    const limits lim = limits_of(ctx);
    /* silent: dead, although they can be used */
    uint32_t dead = 0, silent = 0, turned = 0, grown = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const int state = judge_row(ctx, frame, lim, i);
        dead += state == DEAD;
        silent += state == DEAD && ctx->rows.unusable[i] == 0;
        turned += (state & TURNED) != 0;
        grown += (uint32_t)is_grown(ctx, frame, lim, i);
    }
    /* Many turned rows show another kind of skin, or another order of wires. */
    if (turned >= EITS_ROWS_TO_JUDGE && eits_wants(ctx, EITS_DIAGNOSTIC_MODEL_MISMATCH))
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_MODEL_MISMATCH;
    if (turned + grown > 0 && turned + grown < EITS_ROWS_TO_JUDGE &&
        eits_wants(ctx, EITS_DIAGNOSTIC_OUTLIER))
        leave_impossible(ctx, frame, lim);
    if (dead < EITS_ROWS_TO_JUDGE)
        return 1;
    uint8_t alive[EITS_MAX_ELECTRODES] = {0};
    if (!find_open(ctx, frame, lim, alive))
        return silent < EITS_ROWS_TO_JUDGE;
    if (eits_wants(ctx, EITS_DIAGNOSTIC_BRIDGED))
        find_bridged(ctx, frame, lim, alive);
    if ((ctx->info.diagnostics & (EITS_DIAGNOSTIC_ELECTRODE_OPEN | EITS_DIAGNOSTIC_BRIDGED)) == 0)
        return 1;
    eits_name_electrodes(ctx);
    eits_leave_electrodes(ctx, EITS_ELECTRODE_OPEN, EITS_ROW_OPEN);
    eits_leave_electrodes(ctx, EITS_ELECTRODE_BRIDGED, EITS_ROW_BRIDGED);
    return 1;
}

/* Find touches in the image: they are fitted, pruned and tested, and their force is computed; a
 * second pass may follow.
 *
 * The order matters. The second pass solves the image again for data without the touches'
 * interaction; the touches stay those of the first pass, so that the two do not iterate. */
#include "eitskin/force.h"
#include "eitskin/touch.h"

#include "api/constants.h"
#include "api/stages.h"
#include "context/context.h"
#include "context/places.h"
#include "diagnostics/diagnostics.h"
#include "evidence/evidence.h"
#include "frame/reference.h"
#include "joint/joint.h"
#include "touch/disc.h"
#include "touch/disc_fit.h"

/* Returns 1 if the image may have touches. */
static int may_have_touches(const eits_context *ctx)
{
    const eits_stop stop = ctx->info.stop;
    return stop != EITS_STOP_BELOW_THRESHOLD && stop != EITS_STOP_ZERO &&
           stop != EITS_STOP_DIVERGED;
}

/* Note the share of the data that the discs leave unexplained, and the part of it beyond noise. */
static void note_unexplained(eits_context *ctx, eits_fit *f)
{
    const eits_real left = f->total > 0 ? eits_fit_left(ctx, f) : 0;
    ctx->info.unexplained = f->total > 0 ? left / f->total : 0;
    f->beyond_noise = left > f->noise ? (left - f->noise) / f->total : 0;
}

/* Touches from the image's peaks by the joint fit alone. Returns 1 if they are clear; else `f` has
 * discs that are fitted: the joint fit's where their number is likely right, or those of the whole
 * fit of discs. */
static int fit(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_joint *j)
{
    j->count = 0;
    if (eits_can_fit_jointly(ctx)) {
        eits_fit_peaks(ctx, scratch, f);
        if (eits_fit_clearly(ctx, scratch, f, j))
            return 1;
        const int begun = eits_joint_is_likely(ctx, j);
        const uint64_t macs = f->macs;
        *f = eits_fit_none(ctx, scratch);
        f->macs = macs;
        if (begun) {
            eits_joint_give(ctx, j, f);
            eits_fit_settle(ctx, scratch, f);
            return 0;
        }
    }
    eits_fit_touches(ctx, scratch, f);
    return 0;
}

/* Fit touches; those that this does not make clear are tested, and fitted jointly once more.
 * Whether they are crowded is checked by discs, on which its odds were counted. `found` is
 * overwritten. */
static void fit_and_test(eits_context *ctx, const eits_scratch *scratch, eits_fit *f,
                         eits_touch *found)
{
    eits_joint j;
    ctx->evidence.spent = 0; /* where no test is needed */
    eits_pole_forget(ctx);
    const int clear = fit(ctx, scratch, f, &j);
    if (!clear) {
        note_unexplained(ctx, f);
        eits_test_touches(ctx, scratch, f);
        eits_rate_touches(ctx, f);
        eits_fit_centre(ctx, scratch, f);
        eits_place_touches(ctx, scratch, f);
        note_unexplained(ctx, f);
    }
    eits_check_crowd(ctx, found, eits_report_touches(ctx, f, found));
    if (f->count > 0)
        eits_recheck_stale_reference(ctx);
    if (!clear)
        eits_fit_jointly(ctx, scratch, f, &j);
}

/* Return which image shows the frame: that of the touches if they explain it. */
static eits_shown shown(const eits_context *ctx, const eits_fit *f, const eits_touch *found,
                        uint32_t count)
{
    const eits_real most = eits_can_fit_jointly(ctx) ? EITS_SHOWN_UNEXPLAINED : EITS_SHOWN_UNTESTED;
    int drawn = count > 0;
    for (uint32_t k = 0; k < count; ++k)
        drawn &= found[k].explained > 0; /* others are not drawn */
    return drawn && f->beyond_noise < most ? EITS_SHOWN_TOUCHES : EITS_SHOWN_SOLVER;
}

eits_status eits_find_touches(eits_context *ctx, eits_touch *touches, uint32_t room,
                              uint32_t *count)
{
    if (ctx == NULL || (touches == NULL && room > 0))
        return EITS_E_ARGUMENT;
    const eits_scratch *scratch = &ctx->scratch;
    eits_fit f = eits_fit_none(ctx, scratch);
    eits_touch found[EITS_MAX_TOUCHES];
    /* An image that is zero for the reason given by info.stop has no touches. */
    ctx->info.unexplained = 0;
    eits_check_crowd(ctx, found, 0); /* CROWDED only of this frame's touches */
    if (may_have_touches(ctx)) {
        fit_and_test(ctx, scratch, &f, found);
        if (eits_check_drift(ctx)) {
            f.count = 0;
            eits_check_crowd(ctx, found, 0);
        }
    }
    const uint32_t reported = eits_report_touches(ctx, &f, found);
    for (uint32_t k = 0; f.tested && k < reported; ++k) {
        eits_real at[2] = {found[k].x_mm, found[k].y_mm};
        eits_place_on_skin(ctx, at);
        found[k].x_mm = at[0];
        found[k].y_mm = at[1];
    }
    ctx->info.touch_macs = f.macs;
    eits_check_count(ctx, &f);
    ctx->info.touches = reported;
    ctx->info.shown = shown(ctx, &f, found, reported);
    for (uint32_t k = 0; k < reported; ++k) {
        eits_bring_onto_skin(ctx, &found[k].x_mm, &found[k].y_mm);
        found[k].id = k + 1;
        found[k].confirmed = 1;
        found[k].force_n =
            eits_force_n(ctx->model, found[k].x_mm, found[k].y_mm, found[k].strength_s_per_m_mm2);
    }
    /* The second pass comes last, since it overwrites image, info and scratch. */
    if (ctx->options.second_pass && ctx->options.mac_limit == 0 && f.count > 1 &&
        f.data == ctx->touch.y_separate)
        eits_solve_again(ctx, scratch, ctx->touch.y_separate);
    for (uint32_t k = 0; k < reported && k < room; ++k)
        touches[k] = found[k];
    if (count != NULL)
        *count = reported;
    const int known = (ctx->info.diagnostics & EITS_DIAGNOSTIC_MODEL_MISMATCH) == 0;
    /* If the reference moved, the coefficients belong to another reference and are not a valid
     * start. */
    if (eits_reference_tracking_end(ctx, scratch, found, reported, known, &ctx->info.touch_macs))
        ctx->solver.warm = 0;
    return EITS_OK;
}

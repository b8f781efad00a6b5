/* Fit discs off the grid to reduced data: strengths, places and radii; which discs to keep, to
 * merge or to split. */
#ifndef EITSKIN_FIT_H
#define EITSKIN_FIT_H

#include "touch/disc.h"

/* The state that is needed to undo a trial. Atoms and residual follow from the discs; computing
 * them again is rare and costs less than keeping copies. */
typedef struct eits_fit_kept {
    eits_disc disc[EITS_MAX_TOUCHES];
    uint32_t count;
    eits_real left; /* |residual|^2 */
} eits_fit_kept;

typedef struct eits_fit {
    eits_disc disc[EITS_MAX_TOUCHES];
    /* the increase of |residual|^2 without the disc, relative to |y|^2 */
    eits_real explained[EITS_MAX_TOUCHES];
    /* 1: the touch test (evidence/touch_test.c) was made */
    uint32_t tested;
    uint32_t changed; /* 1: the test has changed the discs */
    uint32_t settled; /* 1: places and radii are fitted; 0: they are those of peaks */
    uint32_t joint;   /* 1: the discs are those of the joint fit, with sharp edges */
    uint32_t drifts;  /* 1: it is more likely that the skin has drifted since its reference */
    /* minus twice the logarithm of the likelihood ratio, without the disc over with it, divided by
     * the excess of the misfit over noise */
    eits_real rise[EITS_MAX_TOUCHES];
    /* covariance of x and y: xx, xy, yy, mm^2 */
    eits_real place_mm2[EITS_MAX_TOUCHES][3];
    /* the place that the test would give to the disc, minus its place */
    eits_real apart_mm[EITS_MAX_TOUCHES][2];
    /* logarithm of the odds that the disc is two touches (evidence/pair.c) */
    eits_real pair[EITS_MAX_TOUCHES];
    /* from the joint fit: half of the long axis, as a vector; 0, 0: the data do not distinguish it
     * from a disc */
    eits_real long_mm[EITS_MAX_TOUCHES][2];
    /* from the joint fit: standard deviation of the radius; 0: the data do not determine the radius
     */
    eits_real radius_sd_mm[EITS_MAX_TOUCHES];
    /* probability that the disc is one touch (evidence/confidence.c) */
    eits_real confidence[EITS_MAX_TOUCHES];
    const eits_real *data; /* stride numbers: the data that the discs have to explain */
    eits_real *residual; /* stride numbers, row 0 of the scratch: `data` minus the discs' answers */
    eits_real total;     /* |y|^2 */
    /* the part of `total` that is expected from noise; 0 if no noise was learned */
    eits_real noise;
    eits_real beyond_noise; /* the part of the data that the touches leave beyond noise, relative to
                               the data */
    /* options.touch_radius_weight, times a factor of the present stage of the touch fit */
    eits_real radius_weight;
    uint32_t count;
    uint32_t cut;  /* 1: steps were left out because of EITS_FIT_WORK */
    uint64_t macs; /* multiply-accumulates of this frame's touches so far */
} eits_fit;

/* Return the k-th disc's answer to 1 S/m: stride numbers. */
static inline eits_real *eits_atom(const eits_context *ctx, uint32_t k)
{
    return ctx->touch.atoms + EITS_STRIDE(ctx->model->rank) * k;
}

/* Return a limit of f->macs: `per_fold` multiply-accumulates for each fold of the model, and for at
 * least EITS_LEAST_FOLDS folds. */
uint64_t eits_fit_limit(const eits_context *ctx, uint32_t per_fold);

/* Return 1 if the fit of discs may begin another step; otherwise set f->cut. */
int eits_fit_may_go_on(const eits_context *ctx, eits_fit *f);

/* disc_fit.c */

/* Begin a fit to the frame's data, without discs. */
eits_fit eits_fit_none(const eits_context *ctx, const eits_scratch *scratch);

/* Return |residual|^2. */
eits_real eits_fit_left(const eits_context *ctx, const eits_fit *f);

/* Fit all strengths together by coordinate descent, starting from 0. */
void eits_fit_strengths(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Compute atoms and residual of the present discs again, after a change of discs or data. */
void eits_fit_restart(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Keep the present discs, and return to them. */
eits_fit_kept eits_fit_keep(const eits_context *ctx, const eits_fit *f);
void eits_fit_undo(eits_context *ctx, const eits_scratch *scratch, eits_fit *f,
                   const eits_fit_kept *kept);

/* Return the change along `atom` that explains `target` best and has the disc's own sign. */
eits_real eits_best_change(const eits_context *ctx, const eits_disc *disc, const eits_real *atom,
                           const eits_real *target);

/* Return the expected radius: the one that the strength suggests if the model states the change
 * under a touch, else the seed's radius.
 */
eits_real eits_expected_radius(const eits_options *o, const eits_disc *disc);

/* Make up to `sweeps` sweeps of Gauss-Newton steps over the discs `first` to `last`, both included,
 * until they settle. No step begins after EITS_FIT_WORK. */
void eits_fit_move(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t first,
                   uint32_t last, uint32_t sweeps);
void eits_fit_move_all(eits_context *ctx, const eits_scratch *scratch, eits_fit *f,
                       uint32_t sweeps);

/* prune.c */

/* Compute f->explained from the present atoms and strengths. */
void eits_fit_explain(eits_context *ctx, eits_fit *f);

/* Drop the weakest disc as long as it explains too little or does not stand out from the noise. The
 * other discs are fitted again each time. */
void eits_fit_prune(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* split_merge.c: no merge is tried once the frame's work has reached EITS_FIT_WORK, and no split
 * after EITS_SPLIT_WORK */

/* Merge overlapping or nearly touching discs if one disc explains as much. Returns 1 if any were
 * merged. */
int eits_fit_merge(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Split a disc if two discs explain clearly more. Returns 1 if any was split. */
int eits_fit_split(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* seek.c */

/* Find discs from the data without the image: each is put at the place where a disc explains most
 * of the data that the others leave. */
void eits_fit_seek(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* If the instrument is far from the model and the only disc is uncertain (f->confidence), replace
 * it by a disc of the seed's radius at the middle of the image's blob. f->place_mm2 is then as wide
 * as the blob. */
void eits_fit_centre(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* touch.c */

/* Turn the peaks of the image into discs; place and strength follow from the image around each peak
 * alone. */
void eits_fit_peaks(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Do only the last stage of eits_fit_touches, for discs whose places and radii are nearly right. */
void eits_fit_settle(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Start discs at the peaks of the image and fit them to the frame's data; f->count of them are
 * touches. */
void eits_fit_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Write the discs as touches without ids, strongest first. Discs with numbers that are not finite
 * are left out. Returns the number of touches. */
uint32_t eits_report_touches(const eits_context *ctx, const eits_fit *f, eits_touch *out);

#endif

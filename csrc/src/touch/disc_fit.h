/* Discs fitted off the grid to reduced data: strengths, places, radii; which to keep; which to
 * merge or to split. */
#ifndef EITSKIN_FIT_H
#define EITSKIN_FIT_H

#include "touch/disc.h"

/* Enough to undo a trial: atoms and residual follow from the discs, and cost less to compute again,
 * seldom, than to keep. */
typedef struct eits_fit_kept {
    eits_disc disc[EITS_MAX_TOUCHES];
    uint32_t count;
    eits_real left; /* |residual|^2 */
} eits_fit_kept;

typedef struct eits_fit {
    eits_disc disc[EITS_MAX_TOUCHES];
    /* what leaving it out would add to |residual|^2, relative to |y|^2 */
    eits_real explained[EITS_MAX_TOUCHES];
    /* the test of touches (evidence/touch_test.c): 1 where it was made */
    uint32_t tested;
    uint32_t changed; /* 1: the test has changed the discs */
    uint32_t settled; /* 1: places and radii are fitted; 0: they are those of peaks */
    uint32_t joint;   /* 1: discs are as the joint fit has them, with sharp edges */
    uint32_t drifts;  /* 1: the data are likelier of a sheet that has drifted since its reference */
    /* minus twice the logarithm of the ratio of likelihoods without and with the disc, over the
     * data's own misfit where that is more than noise */
    eits_real rise[EITS_MAX_TOUCHES];
    /* covariance of x and y: xx, xy, yy, mm^2 */
    eits_real place_mm2[EITS_MAX_TOUCHES][3];
    /* where the test would have the disc, less where it is */
    eits_real apart_mm[EITS_MAX_TOUCHES][2];
    /* logarithm of the odds that the disc is two touches (evidence/pair.c) */
    eits_real pair[EITS_MAX_TOUCHES];
    /* of the joint fit: half of the long axis, as a vector; 0, 0: as far as the data tell a disc */
    eits_real long_mm[EITS_MAX_TOUCHES][2];
    /* of the joint fit: standard deviation of the radius; 0: the data do not tell the radius */
    eits_real radius_sd_mm[EITS_MAX_TOUCHES];
    /* probability that the disc is one touch (evidence/confidence.c) */
    eits_real confidence[EITS_MAX_TOUCHES];
    const eits_real *data; /* stride: what the discs are to explain */
    eits_real *residual;   /* stride, row 0 of the scratch: what they leave of it */
    eits_real total;       /* |y|^2 */
    /* of that, what noise is expected to give; 0 where none was learned */
    eits_real noise;
    eits_real beyond_noise; /* what the touches leave of the data beyond that, relative to them */
    /* options.touch_radius_weight, times what the stage of the touch fit asks for */
    eits_real radius_weight;
    uint32_t count;
    uint32_t moves; /* steps of single discs so far */
    uint64_t macs;
} eits_fit;

/* Where the k-th disc's answer to 1 S/m is kept: stride numbers. */
static inline eits_real *eits_atom(const eits_context *ctx, uint32_t k)
{
    return ctx->touch.atoms + EITS_STRIDE(ctx->model->rank) * k;
}

/* disc_fit.c */

/* No discs yet, of the frame's data. */
eits_fit eits_fit_none(const eits_context *ctx, const eits_scratch *scratch);

/* |residual|^2. */
eits_real eits_fit_left(const eits_context *ctx, const eits_fit *f);

/* All strengths at once by coordinate descent, from none. */
void eits_fit_strengths(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Atoms and residual of the discs as they are; after a change of discs or data. */
void eits_fit_restart(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* The discs as they are, and back to them. */
eits_fit_kept eits_fit_keep(const eits_context *ctx, const eits_fit *f);
void eits_fit_undo(eits_context *ctx, const eits_scratch *scratch, eits_fit *f,
                   const eits_fit_kept *kept);

/* The change that explains `target` best along `atom`, of the disc's own sign. */
eits_real eits_best_change(const eits_context *ctx, const eits_disc *disc, const eits_real *atom,
                           const eits_real *target);

/* The radius that is expected: what strength suggests where the change is known, else the seed's.
 */
eits_real eits_expected_radius(const eits_options *o, const eits_disc *disc);

/* Sweeps of Gauss-Newton's steps over discs `first` to `last`, until they settle. */
void eits_fit_move(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t first,
                   uint32_t last, uint32_t sweeps);
void eits_fit_move_all(eits_context *ctx, const eits_scratch *scratch, eits_fit *f,
                       uint32_t sweeps);

/* prune.c */

/* f->explained from the atoms and strengths as they are. */
void eits_fit_explain(eits_context *ctx, eits_fit *f);

/* Drop the weakest while it explains too little or does not stand out of the noise; the
 * others take up what it leaves. */
void eits_fit_prune(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* split_merge.c: neither tries any more once the fit has made EITS_FIT_MOVES */

/* Overlapping or nearly touching discs become one where that explains as much. Returns 1 where any
 * did. */
int eits_fit_merge(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* A disc becomes two where they explain clearly more. Returns 1 where any did. */
int eits_fit_split(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* seek.c */

/* Discs of the data without the image, each where what the others leave answers most. */
void eits_fit_seek(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Where the instrument is far from the model and the only disc is not sure (f->confidence): a disc
 * of the seed's radius at the middle of the image's blob, f->place_mm2 as wide as that. */
void eits_fit_centre(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* touch.c */

/* Peaks of the image as discs: places and strengths by the image around each alone. */
void eits_fit_peaks(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* The last stage of that fit alone, for discs whose places and radii are nearly right. */
void eits_fit_settle(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* Peaks of the image start discs, which are fitted to the frame's data; f->count of them are
 * touches. */
void eits_fit_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f);

/* The discs as touches without ids, strongest first; returns how many there are: those whose
 * numbers are finite. */
uint32_t eits_report_touches(const eits_context *ctx, const eits_fit *f, eits_touch *out);

#endif

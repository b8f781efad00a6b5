/* eitskin: one reconstruction context in memory that the caller owns.
 *
 * Order of calls: eits_model_open, eits_init, a reference frame (eits_reference_*), then
 * eits_reconstruct and, if touches are wanted, eits_find_touches for each frame. Contexts fraction
 * nothing; one context is used by one thread at a time.
 */
#ifndef EITSKIN_CONTEXT_H
#define EITSKIN_CONTEXT_H

#include "eitskin/diagnostics.h"
#include "eitskin/model.h"
#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EITS_MAX_TOUCHES      16
#define EITS_MAX_TRACK_FRAMES 1000u

/* Which conductivity changes are looked for. */
typedef enum eits_sign {
    EITS_SIGN_INCREASE = 0, /* x >= 0: touches by something that conducts better */
    EITS_SIGN_DECREASE = 1, /* x <= 0 */
    EITS_SIGN_BOTH = 2
} eits_sign;

/* What the touch fit does beyond fitting discs to the image's peaks. */
typedef enum eits_touch_fit {
    /* first to v0 log(v / v0), which strong touches bend less; models of differences */
    EITS_TOUCH_FIT_LOG_DATA = 1,
    /* discs that are one touch are merged, those that are two are split; where data are
     * linear or corrected for interaction, for what bends them looks like more touches */
    EITS_TOUCH_FIT_SPLIT_MERGE = 2,
    /* what touches do to each other's field is taken out of the data; models of differences with
     * fields */
    EITS_TOUCH_FIT_INTERACTION = 4
} eits_touch_fit;
#define EITS_TOUCH_FIT_ALL 7u

typedef struct eits_options {
    uint32_t iterations; /* at most so many; exactly so many where gap_rel is 0 */
    /* iterations between checks of the gap and of divergence, and until the working set is
     * chosen anew; at least 1 */
    uint32_t gap_every;
    uint32_t max_touches; /* at most EITS_MAX_TOUCHES */
    uint32_t max_masked;  /* a frame with more unusable rows than this is refused */
    eits_sign sign;
    eits_solver solver;
    /* 1: start from the last frame's coefficients, momentum reset; see solve.h for what it does */
    uint32_t warm_start;
    /* 1: ignore changes along the reference frame, that is drift of the gain */
    uint32_t project_reference;
    eits_real lambda_abs; /* > 0: this lambda, in the units of S'y; 0: by the rule below */
    /* lambda = max(lambda_rel lambda_max, lambda_noise_factor lambda_noise) */
    eits_real lambda_rel;
    eits_real lambda_noise_factor;
    eits_real detection_factor; /* no touch where lambda_max < detection_factor lambda_noise; 0: no
                                   threshold */
    eits_real gap_rel;          /* > 0: stop once gap <= gap_rel |y|^2 / 2 */
    eits_real saturation_v;     /* > 0: a channel at or beyond +-saturation_v is unusable */
    /* a local maximum below this fraction of the greatest starts no touch */
    eits_real touch_threshold;
    /* a touch that explains less than this fraction of |y|^2 beside the others is dropped */
    eits_real touch_min_fraction;
    eits_real touch_min_radius_mm, touch_max_radius_mm, touch_seed_radius_mm;
    /* expected conductivity change under a touch: tells radius from strength; 0: unknown */
    eits_real touch_change_s_per_m;
    /* how much the radius so told counts against the data, relative to the touch's energy */
    eits_real touch_radius_weight;
    /* sweeps of the off-grid fit over all touches; 0: peaks with their strengths only */
    uint32_t touch_sweeps;
    /* a touch that moved at most so far since the last frame keeps its id */
    eits_real follow_mm;
    /* > 0: stop where the next step and the gap after it would take info.macs beyond this; see
     * solve.h */
    uint32_t mac_limit;
    /* bits of eits_diagnostic that are looked for; EITS_DIAGNOSTICS_ALL by default */
    uint32_t diagnostics;
    uint32_t touch_fit; /* bits of eits_touch_fit; EITS_TOUCH_FIT_ALL by default */
    /* 1: once more than one touch is found, eits_find_touches solves again with their interaction
     * taken out of the data; image and info are then the second image's. Not with a mac_limit */
    uint32_t second_pass;
    /* a doubtful touch is told of once it was found in so many frames on end; 0, 1: at once */
    uint32_t track_confirm;
    /* a touch that is not found keeps its id for so many frames, and is told of if it was faint
     * before */
    uint32_t track_hold;
    /* > 0: follow places, radii and strengths in time; how uncertain the place of a touch is
     * whose S'y is as great as noise gives, in pixels */
    eits_real track_smooth;
    /* > 0: the whitening's regularisation is at least this times noise_v / v0_rms, where both are
     * known */
    eits_real regularisation_noise_factor;
} eits_options;

/* Why the solver stopped. */
typedef enum eits_stop {
    EITS_STOP_ITERATIONS = 0, /* the given number of iterations was done */
    EITS_STOP_GAP = 1,        /* the duality gap was small enough */
    EITS_STOP_BELOW_THRESHOLD =
        2, /* lambda_max lies within the noise: no touch, the image is zero */
    /* lambda >= lambda_max: zero is the exact optimum; or |y| < 2^-51 (4.4e-16; double: 1e-146),
     * whose square says nothing */
    EITS_STOP_ZERO = 3,
    /* the objective rose, or all went to zero, although the step was halved again and again; the
     * image is zero */
    EITS_STOP_DIVERGED = 4,
    /* the next step would have passed mac_limit: the image is the best until then */
    EITS_STOP_MACS = 5,
    /* no coefficient moves any more but by rounding: coordinate descent and active set */
    EITS_STOP_OPTIMUM = 6
} eits_stop;

/* What a reconstruction cost and how it ended. */
typedef struct eits_info {
    uint32_t iterations;
    eits_stop stop;
    uint32_t nonzeros; /* coefficients that are not zero */
    uint32_t masked;   /* protocol rows that were left out of this frame */
    uint32_t step_halvings;
    uint32_t touches; /* set by eits_find_touches */
    /* multiply-accumulates with a stored matrix, a basis vector, F or the active set's factor;
     * vector sums not counted */
    uint64_t macs;
    uint64_t touch_macs; /* the same for eits_find_touches */
    eits_real lambda;
    eits_real lambda_max;
    eits_real lambda_noise; /* the reference's, times what rows left out add */
    /* duality gap at the result, absolute; 0 where stop is BELOW_THRESHOLD, ZERO or DIVERGED, and
     * where MACS came before anything was known */
    eits_real gap;
    eits_real gap_rel;    /* gap / (|y|^2 / 2) */
    eits_real residual;   /* |y - S x| */
    eits_real data_norm;  /* |y| */
    uint32_t diagnostics; /* bits of eits_diagnostic; CROWDED is set by eits_find_touches */
    uint32_t saturated;   /* rows, masked ones apart */
    uint32_t outliers;    /* rows left out as outliers */
    /* fraction of |d| beyond noise that the model's range cannot give, 0 to 1; 0 where it was not
     * judged */
    eits_real model_mismatch;
    /* fraction of |y|^2 that the touches leave, set by eits_find_touches; 0 where none were looked
     * for */
    eits_real unexplained;
    /* bit e: electrode e, of the first 64; ctx->electrode has all */
    uint64_t open_electrodes, bridged_electrodes, noisy_electrodes;
    /* of the whitening, over s_1^2, as this frame was reduced; 0 where the model does not tell */
    eits_real regularisation;
} eits_info;

typedef struct eits_touch {
    uint32_t id; /* counts up from 1; follows a finger from frame to frame */
    eits_real x_mm, y_mm;
    eits_real radius_mm;
    eits_real strength_s_per_m_mm2; /* conductivity change integrated over the touch: S/m mm^2 */
    /* fraction of |y|^2 that leaving this touch out would leave unexplained: 0 to 1; 0 where it was
     * not found in this frame and is cached */
    eits_real confidence;
    /* how hard it presses, N; 0 where the model is not calibrated (force.h) */
    eits_real force_n;
} eits_touch;

/* A touch that is followed (track.h). */
typedef struct eits_followed {
    eits_touch touch;       /* as told of; id 0: not yet */
    eits_real vx_mm, vy_mm; /* a frame */
    /* covariance of place and velocity, along either axis */
    eits_real place_mm2, both_mm2, speed_mm2;
    uint32_t seen;   /* frames that it was found in, as far as that is asked */
    uint32_t missed; /* frames on end that it was not */
    uint32_t faint;  /* 1: its own S'y was below that of noise when it was last found */
} eits_followed;

/* matrix products, chosen at start-up among builds that give the same bits */
struct eits_kernels;

/* Learned from reference frames. */
typedef struct eits_reference {
    /* n_rows: mean of the reference frames, V; NaN for a row that was masked in any of them */
    eits_real *v0;
    eits_real *m2; /* n_rows: sum of squared deviations, in m2_unit^2 */
    /* V: a power of two near the first reference frame's greatest voltage, so that squares are
     * numbers */
    eits_real m2_unit;
    uint32_t wanted, count;
    uint32_t ready;
    eits_real v0_rms; /* rms of v0 over the rows in use, V */
    /* model volts per measured volt: rms(v_ref) / rms(v0), negative where correlation is */
    eits_real gain;
    /* of v0 with v_ref on the folded rows: near 1 where skin, order and sign are right */
    eits_real correlation;
    eits_real noise_v; /* rms over rows of the reference frames' deviation, V; 0 if unknown */
    /* greatest max(S'y) seen in reference frames, as with all rows in use; 0 if unknown */
    eits_real lambda_noise;
    uint32_t second_waits; /* the second reference frame is in m2 until there is a third */
    uint32_t outliers;     /* readings of reference frames that were left out of the reference */
} eits_reference;

typedef struct eits_context {
    const eits_model *model;
    const struct eits_kernels *kernels;
    eits_options options;
    eits_reference reference;
    uint8_t *masked; /* n_rows: masked by the caller */
    /* n_rows: why a row is left out of this frame, bits of eits_row_state; 0: it is used */
    uint8_t *unusable;
    uint8_t electrode[EITS_MAX_ELECTRODES]; /* bits of eits_electrode_state, of the last frame */
    /* n_folded: which rows of each fold were in use when the basis below was built; 0: neither */
    uint8_t *basis_for;
    eits_real *d; /* n_folded: data of this frame */
    /* n_folded: what the two rows of each fold differ by; 0 where one is in use */
    eits_real *reciprocity_error;
    /* n_folded: data of a drift of the gain; zeros where it is not ignored */
    eits_real *gain_drift;
    eits_real *off_range; /* n_folded: what of that the model cannot give, unless stale */
    uint32_t off_range_stale;
    /* stride each: 1 / |P_i|^2, and so much of it as predicts d (model_mismatch.c) */
    eits_real *range_inverse, *range_shrink;
    /* |P|^2: what unit noise on the folded rows makes of |y|^2; less where the regularisation is
     * raised */
    eits_real reduction_energy;
    eits_real reduction_energy_stored; /* as with the model's regularisation */
    /* 1: P's rows are orthogonal, so that what the model cannot give can be told */
    uint32_t range_known;
    eits_real *y; /* stride: reduced data, projected */
    /* stride each: of v0 log(v / v0); y less the touches' interaction */
    eits_real *y_log, *y_separate;
    uint32_t has_y_log; /* 1: y_log is this frame's */
    /* orthonormal directions to ignore, up to rank of them, stride apart; where masked_whitening,
     * at most one, and behind it two triangles (whitening.c) */
    eits_real *basis;
    uint32_t basis_count;
    uint32_t basis_stale;
    /* 1: the model's P and S have the builder's form, so that rows left out can be whitened again
     */
    uint32_t can_whiten_masked;
    /* other than 0: for basis_for, or for the noise, the solver's S is F S (whitening.h) */
    uint32_t masked_whitening;
    /* stride: s_1 of the scaled Jacobian over that of each direction, and over w s_1 of the
     * first */
    eits_real *row_scale;
    eits_real *row_strength;           /* stride: (s_i / s_1)^2 */
    eits_real strongest;               /* s_1, in the units of 1 / P */
    eits_real strongest_square;        /* |S_1|^2 */
    eits_real regularisation;          /* mu, by which the model was whitened */
    eits_real regularisation_in_force; /* mu' of the frames as basis_for has them */
    eits_real whitening_square;        /* what F'F is scaled by */
    /* how much more noise max(S'y) has so than with all rows; 1 where nothing is whitened for
     * masked rows */
    eits_real noise_ratio;
    eits_real *adjoint;           /* stride: F' of the residual, and scratch */
    eits_real *residual;          /* stride */
    eits_real *sx, *sx_next, *sz; /* stride each */
    eits_real *slope[3];          /* stride each: a touch's response by x, y and radius */
    eits_real *x, *x_next, *z;    /* n_pixels each: coefficients, and the extrapolated point */
    eits_real *gradient;          /* n_pixels */
    /* max(n_pixels, n_folded): numbers to multiply columns by, scales included */
    eits_real *list_value;
    uint32_t *list_index; /* as many: those columns */
    /* n_pixels: the working set's columns; x, x_next, z hold theirs only while it runs */
    uint32_t *working;
    uint32_t working_count;
    /* rank x stride: rows that make the active set's columns orthonormal (factor.h) */
    eits_real *factor;
    eits_real *image; /* n_pixels: S/m */
    eits_real *atoms; /* EITS_MAX_TOUCHES x stride: responses of the touches */
    /* ny x nx: which kept pixel a cell of the image is; EITS_NO_PIXEL for none */
    uint16_t *cell;
    eits_real *panels;         /* S again, in panels of EITS_PANEL columns; NULL: not prepared */
    eits_real *working_panels; /* the working set's columns likewise; NULL: not prepared */
    /* EITS_CACHED(n_pixels) x stride: columns of S in use, unpacked (column_cache.h) */
    float *cache;
    uint16_t *cache_slot;    /* n_pixels: where a column is cached; EITS_NO_PIXEL: nowhere */
    uint16_t *cache_column;  /* EITS_CACHED(n_pixels): which column is cached there */
    uint8_t *cache_wanted;   /* as many: scratch */
    uint32_t cache_next;     /* where to look for room */
    uint32_t *working_slot;  /* EITS_CACHED(n_pixels): where the working set's columns are cached */
    uint32_t working_cached; /* 1: all of them are */
    eits_followed followed[EITS_MAX_TOUCHES];
    uint32_t followed_count, next_id;
    uint32_t warm;  /* x holds the last frame's coefficients */
    eits_info info; /* of the last frame */
} eits_context;

#define EITS_PANEL      32u
#define EITS_NO_PIXEL   0xFFFFu
#define EITS_MAX_CACHED 256u
#define EITS_CACHED(n_pixels) \
    ((size_t)((n_pixels) < EITS_MAX_CACHED ? (n_pixels) : EITS_MAX_CACHED))
#define EITS_LINE                                                                                \
    64u /* bytes: panels start at a multiple, where no vector of theirs lies across two lines of \
           the cache */
#define EITS_ALIGN16(bytes)           (((size_t)(bytes) + 15u) & ~(size_t)15u)
#define EITS_STRIDE(rank)             (((size_t)(rank) + 7u) & ~(size_t)7u)
#define EITS_REALS(count)             EITS_ALIGN16((size_t)(count) * sizeof(eits_real))
#define EITS_LIST(n_pixels, n_folded) ((size_t)((n_pixels) > (n_folded) ? (n_pixels) : (n_folded)))
#define EITS_PADDED_TRIANGLE(rank)    (EITS_STRIDE(rank) * (EITS_STRIDE(rank) + 8u) / 2u)
#define EITS_PANEL_COLUMNS(n_pixels) \
    (((size_t)(n_pixels) + EITS_PANEL - 1u) / EITS_PANEL * EITS_PANEL)

/* Bytes of workspace; a constant expression. n_cells is nx * ny; `prepared` is 1 to keep panel-wise
 * copies of S and of the working set (hosts), else 0. */
#define EITS_WORKSPACE_SIZE(n_rows, n_folded, rank, n_pixels, n_cells, prepared)                   \
    (2 * EITS_REALS(n_rows) + 2 * EITS_ALIGN16(n_rows) + EITS_ALIGN16(n_folded) +                  \
     4 * EITS_REALS(n_folded) +                                                                    \
     (24 + EITS_STRIDE(rank) + (size_t)(rank) + EITS_MAX_TOUCHES) *                                \
         EITS_REALS(EITS_STRIDE(rank)) +                                                           \
     5 * EITS_REALS(n_pixels) + EITS_REALS(EITS_LIST(n_pixels, n_folded)) +                        \
     EITS_ALIGN16(EITS_LIST(n_pixels, n_folded) * 4u) + EITS_ALIGN16((size_t)(n_pixels) * 4u) +    \
     EITS_ALIGN16((size_t)(n_cells) * 2u) +                                                        \
     EITS_ALIGN16(EITS_CACHED(n_pixels) * EITS_STRIDE(rank) * 4u) +                                \
     EITS_ALIGN16((size_t)(n_pixels) * 2u) + EITS_ALIGN16(EITS_CACHED(n_pixels) * 2u) +            \
     EITS_ALIGN16(EITS_CACHED(n_pixels)) + EITS_ALIGN16(EITS_CACHED(n_pixels) * 4u) +              \
     ((prepared) ? 2 * EITS_REALS(EITS_PANEL_COLUMNS(n_pixels) * (size_t)(rank)) + EITS_LINE - 16u \
                 : 0u))

/* The same number for an open model, as a function. Returns 0 for a null model. */
size_t eits_workspace_size(const eits_model *model, int prepared);

/* The model's defaults as options. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_default(const eits_model *model, eits_options *options);

/* Change `options` to what suits frames that follow one another, 48 or 96 a second
 * (docs/guide/tracking.md): the detection threshold a quarter lower, and the touches that come of
 * it followed in time, so that those of noise are not told of. A frame by itself then misses faint
 * touches: each needs those before it. Errors: EITS_E_ARGUMENT. */
eits_status eits_options_track(eits_options *options);

/* Lay out `ctx` in `workspace`, set the model's default options. With room for it (see `prepared`
 * above) S is also copied into panels, which is faster where memory is plentiful and gives the same
 * bits. Errors: EITS_E_ARGUMENT, EITS_E_WORKSPACE (smaller than eits_workspace_size(model, 0), or
 * not aligned to 16 bytes). */
eits_status eits_init(eits_context *ctx, const eits_model *model, void *workspace, size_t size);

/* Replace the options. Errors: EITS_E_ARGUMENT for one that is out of range or not finite; then
 * nothing is changed. */
eits_status eits_set_options(eits_context *ctx, const eits_options *options);

/* Use the portable matrix products (1) or the fastest that this processor has (0, the default).
 * Same bits. */
eits_status eits_use_portable_kernels(eits_context *ctx, int portable);

/* "portable", "avx2"... of the kernels in use. */
const char *eits_kernels_name(const eits_context *ctx);

/* Forget the warm start and the touches that were followed. */
void eits_forget(eits_context *ctx);

#ifdef __cplusplus
}
#endif
#endif

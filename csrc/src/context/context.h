/* The parts of a context, for use inside the library.
 *
 * Each part belongs to one module (a folder of csrc/src). Once it is laid out, only that module
 * writes it, and the modules above read it. tests/python/core/test_modules.py checks this, and that
 * no module includes one above it. All memory comes from the caller's workspace and is laid out
 * once, by api/setup.c. "stride" is EITS_STRIDE(rank): rank, rounded up to whole vectors of the
 * kernels. */
#ifndef EITSKIN_CONTEXT_PARTS_H
#define EITSKIN_CONTEXT_PARTS_H

#include "context/column_cache.h"
#include "eitskin/context.h"
#include "eitskin/diagnostics.h"
#include "kernels/kernels.h"

enum { EITS_SCRATCH_ROWS = 8, EITS_SCRATCH_PIXELS = 3 };

/* Reference tracking: the mean under way, and what it is compared with. Written by
 * frame/reference_tracking. */
typedef struct eits_reference_tracking {
    uint32_t seen;    /* frames since the reference was taken */
    uint32_t touches; /* touches in the last frame; EITS_TOUCHES_UNKNOWN: it cannot be used */
    eits_real at[EITS_MAX_TOUCHES][2]; /* and their places, mm */
    uint32_t rest;   /* frames with as many touches that must pass before a mean begins */
    uint32_t frames; /* consecutive frames whose differences are summed in the reference's m2 */
    uint32_t open;   /* 1: the last frame's difference is summed, its touches are not known yet */
    uint32_t means;  /* means since the number of touches changed */
    eits_real gain;  /* with touches: the frame's size over the reference's in the first mean */
    eits_real level; /* max(S'y) of the untouched skin in the first mean; 0: not known */
} eits_reference_tracking;
#define EITS_TOUCHES_UNKNOWN UINT32_MAX

/* How much the frames of a reference differ from the mean before them, in m2_unit^2: the common
 * part of the changes of reciprocal rows, their difference, and the rows themselves, summed over
 * `pairs`. Written by frame/reference. */
typedef struct eits_stillness {
    eits_real common, apart, size;
    uint32_t pairs;
} eits_stillness;

/* The reference frame and its noise. Written by frame/reference. */
typedef struct eits_reference {
    /* n_rows: mean of the reference frames, V; NaN for a row that was masked in any of them */
    eits_real *v0;
    /* n_rows: the factor of a row's data beside the gain; 1 if row gains are not used */
    eits_real *row_gain;
    uint32_t count; /* reference frames that are in v0 */
    uint32_t ready; /* 1: frames can be measured against it */
    eits_real v0_rms;
    eits_real gain;
    /* distance of v0 from the model: rms over folds of log(gain v0 / v_ref); and the rms difference
     * of rows from their reciprocals, relative to v0's rms */
    eits_real distance, reciprocity;
    /* the variance, mm^2, that errors of electrodes and outline, as v0 shows them, add to a place;
     * 0 if the model does not state it */
    eits_real place_mm2;
    eits_real
        place_trust; /* the fraction of the displacement of places that is corrected, 0 to 1 */
    /* mm, along x and y: the polynomial's coefficients of that correction (frame/places.c) */
    eits_real shift_mm[2][EITS_MAX_MOVE_TERMS];
    uint32_t row_gains; /* 1: row gains are used */
    uint32_t far;       /* 1: the instrument, not the skin, differs from the model */
    eits_real correlation;
    eits_real noise_v;
    eits_real lambda_noise;
    uint32_t outliers;
    eits_reference_tracking tracking;
    /* n_rows. While a reference is learned: the sum of squared deviations, in m2_unit^2. With
     * reference tracking: the sum of the frames' differences, NaN for a row that one of them lacks
     */
    eits_real *m2;
    /* V: a power of two near the greatest voltage of the first reference frame, so that squares
     * neither overflow nor vanish */
    eits_real m2_unit;
    eits_stillness still;
    uint32_t wanted;       /* the number of frames to learn from */
    uint32_t second_waits; /* 1: the second reference frame is in m2, until the third one comes */
} eits_reference;

/* A row of eits_rows.masked that is left out of the present reference frame only. */
enum { EITS_MASKED_NOW = 2 };

/* The rows and electrodes in use. Written by frame and diagnostics. */
typedef struct eits_rows {
    uint8_t *masked; /* n_rows: 1 by the caller, EITS_MASKED_NOW by a reference frame */
    /* n_rows: why a row is left out of this frame, bits of eits_row_state; 0: it is used */
    uint8_t *unusable;
    uint8_t electrode[EITS_MAX_ELECTRODES]; /* bits of eits_electrode_state, of the last frame */
} eits_rows;

/* The rows of a fold that are in use. */
enum { EITS_SIDE_NONE = 0, EITS_SIDE_FIRST = 1, EITS_SIDE_SECOND = 2, EITS_SIDE_BOTH = 3 };

/* One frame, folded and reduced. Written by frame. */
typedef struct eits_frame {
    uint8_t *sides;      /* n_folded: EITS_SIDE_..., of the last frame */
    uint8_t *kept_sides; /* n_folded: the sides of the last solved frame while another frame is
                            examined */
    eits_real *d;        /* n_folded: data */
    /* n_folded: the difference of each fold's two rows; 0 if only one is in use */
    eits_real *reciprocity_error;
    eits_real *y;       /* stride: reduced data, projected: the solver's data */
    eits_real *y_log;   /* stride: the same of v0 log(v / v0) */
    uint32_t has_y_log; /* 1: y_log is this frame's */
} eits_frame;

/* Q: the projection that removes directions of the reduced data, such as gain drift. Written by
 * frame. */
typedef struct eits_projection {
    /* orthonormal directions, up to rank of them, stride apart. If the rows that are left are
     * whitened again, there is at most one, and the whitening (below) uses the memory behind it */
    eits_real *basis;
    uint32_t count;
    uint32_t stale;  /* 1: basis and whitening must be built again for the next frame */
    uint32_t builds; /* counts the builds, so that other modules notice when their derived data are
                        out of date */
    /* n_folded: the data that gain drift causes; zeros if it is not ignored */
    eits_real *gain_drift;
} eits_projection;

/* The form of F; the solver uses F S instead of S. */
typedef enum eits_whitening_form {
    /* F = 1: no row is left out and the regularisation is the model's, or the model does not have
     * the builder's form, or numbers overflow */
    EITS_WHITENING_STORED = 0,
    EITS_WHITENING_TRIANGLE = 1, /* rows are left out */
    EITS_WHITENING_DIAGONAL = 2  /* no row is left out, and the regularisation is raised */
} eits_whitening_form;

/* F (frame/whitening.h), for the sides and the noise in force. Written by frame/whitening. */
typedef struct eits_whitening {
    /* 1: the model's P and S have the builder's form, so that the rest can be whitened again if
     * rows are left out */
    uint32_t possible;
    eits_whitening_form form;
    /* stride: s_1 of the scaled Jacobian over that of each direction, and over w s_1 of the
     * first */
    eits_real *row_scale;
    eits_real *row_strength; /* stride: (s_i / s_1)^2 */
    eits_real s1;            /* in the units of 1 / P */
    eits_real s1_square;     /* |S_1|^2 */
    eits_real mu;            /* regularisation of the model's whitening, over s_1^2 */
    eits_real mu_in_force;   /* of this frame */
    eits_real square;        /* the scale of F'F */
    eits_real noise_ratio;   /* noise in max(S'F'y) over that with F = 1 */
    /* |P|^2: the mean |y|^2 of white noise of variance 1 on the folded rows; less if mu is raised
     */
    eits_real energy;
    eits_real energy_stored; /* as with the model's mu */
    eits_real *map;    /* F as a triangle, or its diagonal: behind the basis' first direction */
    eits_real *metric; /* G, a triangle (frame/whitening.h): behind the map */
} eits_whitening;

/* The range of P: all data that the model can explain. Written by diagnostics/model_mismatch. */
typedef struct eits_range {
    uint32_t known;           /* 1: P's rows are orthogonal, so that the range can be tested */
    eits_real *inverse;       /* stride: 1 / |P_i|^2 */
    eits_real *shrink;        /* stride: shrinkage weight per direction when predicting d */
    eits_real *off_range;     /* n_folded: the part of gain drift that lies outside the range */
    uint32_t off_range_build; /* the projection.builds that it belongs to */
    uint32_t against;         /* 1: this frame's change goes against the sign of touches */
} eits_range;

/* The image and the solvers' working memory. Written by solve. x, image and warm outlive a solve;
 * vectors marked "lent" are the scratch's. */
typedef struct eits_solve_state {
    eits_real *x;                 /* n_pixels: coefficients */
    eits_real *image;             /* n_pixels: S/m */
    uint32_t warm;                /* 1: x holds the last frame's coefficients */
    eits_real *x_next, *z;        /* n_pixels each, lent: the next x, and the extrapolated point */
    eits_real *gradient;          /* n_pixels, lent: S'F'(y - F S x) */
    eits_real *sx, *sx_next, *sz; /* stride each, lent: S times x, x_next and z */
    eits_real *residual;          /* stride, lent: Q (y - F S x) */
    eits_real *adjoint;           /* stride, lent: F' of the residual */
    /* n_pixels: the working set's columns; x, x_next, z hold theirs only while it runs */
    uint32_t *working;
    uint32_t working_count;
    eits_real *working_panels; /* the working set's columns in panels; NULL: not prepared */
    uint32_t *working_slot;    /* EITS_CACHED(n_pixels): where the column cache has them */
    uint32_t working_cached;   /* 1: all of them are there */
    /* rank x stride, lent: rows that make the active set's columns orthonormal (active_columns.h)
     */
    eits_real *factor;
} eits_solve_state;

/* Memory of the touch fit. Written by touch. */
typedef struct eits_touch_memory {
    eits_real *atoms;      /* EITS_MAX_TOUCHES x stride: the data that each disc causes */
    eits_real *y_separate; /* stride: y minus the touches' interaction */
} eits_touch_memory;

/* Memory of the touch test. Written by evidence. */
typedef struct eits_evidence {
    eits_real *factor; /* rank x stride: R in the rows of a triangle, Sigma = R'R */
    /* EITS_EVIDENCE_COLUMNS x stride: R'^-1 times the derivative of the data by each parameter */
    eits_real *column;
    eits_real *data;       /* stride: R'^-1 y */
    eits_real *left;       /* stride: R'^-1 times the residual of the touches */
    eits_real *gain_drift; /* stride: R'^-1 times the direction of gain drift, scaled to length 1 */
    uint32_t drifts;       /* 1: gain_drift is in use */
    uint32_t columns_made; /* columns computed since the test of this frame began */
    uint32_t columns_most; /* the present limit of columns_made */
    uint32_t spent;        /* 1: the test needed more columns than it had */
} eits_evidence;

/* Memory of the multipole model: L electrodes, slots of EITS_POLE_FIELD(L) numbers. Written by
 * multipole. */
typedef struct eits_multipole {
    eits_real *home;    /* EITS_MAX_TOUCHES slots: the fields about each touch's home pixel */
    eits_real *own;     /* EITS_MAX_TOUCHES slots: the fields' Taylor coefficients at its middle */
    eits_real *induced; /* EITS_MAX_TOUCHES slots: the field from other touches and the rim */
    eits_real *sent;    /* EITS_MAX_TOUCHES x EITS_POLE_SOURCE(L): the field that each sends out */
    eits_real *work;    /* scratch; undefined after each call */
    uint32_t home_pixel[EITS_MAX_TOUCHES]; /* EITS_NO_HOME: none is kept */
    eits_real mirror[EITS_MAX_TOUCHES][4]; /* a and b of the rim's mirror there, mm */
    /* weights of the pixels around a home pixel inside the skin in the polynomial, complex */
    eits_real inside[2 * EITS_POLE_TERMS * EITS_POLE_POINTS];
} eits_multipole;
#define EITS_NO_HOME UINT32_MAX

/* The knowledge about one touch by the normal equations at the present shapes, with all other
 * parameters free. */
typedef struct eits_joint_known {
    eits_real place[3];   /* covariance of x and y, pixels^2: xx, xy, yy */
    eits_real shape;      /* how far e1 and e2 are from 0, in variances; 0 for a disc */
    eits_real rise;       /* the rise of F if its amplitude is 0 and the others adapt */
    eits_real log_radius; /* variance */
    /* if it were of the other kind: the rise of F, and the change of x, y and log radius */
    eits_real other_rise, other_step[3];
} eits_joint_known;

/* Memory of the joint fit. Written by joint. */
typedef struct eits_joint_memory {
    eits_real *weight; /* n_folded: 1 / sigma; 0 for a fold that is left out */
    eits_real *drift;  /* n_folded: the direction of the gain's drift in that metric, of length 1 */
    eits_real *rest;   /* n_folded: the residual of the held shapes (eits_joint_hold) */
    eits_real *column; /* EITS_JOINT_PARAMETERS x EITS_JOINT_BLOCK */
    eits_real *along;  /* EITS_JOINT_PARAMETERS x EITS_JOINT_NUISANCES */
    eits_real *nuisance; /* their factor L, packed by rows (joint/metric.c) */
    uint32_t errors;     /* vectors of the model's errors in use */
    eits_real error_unit;
    eits_real energy; /* |W d|^2 minus its part along the drift: the misfit without touches */
    eits_real whole;  /* |d|^2 of the folds in use minus its part along the drift */
    eits_real *normal, *factor, *kept; /* EITS_JOINT_TRIANGLE each, packed by rows */
    uint64_t evaluated;                /* multiply-accumulates of the last evaluation with slopes */
    eits_real gradient[EITS_JOINT_PARAMETERS];
    uint32_t is_known; /* 1: `known` belongs to the normal equations and shapes as they are */
    eits_joint_known known[EITS_MAX_TOUCHES];
} eits_joint_memory;

/* Memory that no module owns. Each stage may use all of it, and hands it down to the functions that
 * it calls; they leave it with undefined content. A function that keeps something in it across such
 * a call says in its comment, or by the names of its variables, what it keeps where. While a solver
 * runs, its vectors (eits_solve_state) are rows 0 to 4, pixels 0 to 2 and square. */
typedef struct eits_scratch {
    eits_real *value; /* max(n_pixels, n_folded): what columns are multiplied by, with scales */
    uint32_t *index;  /* as many: which columns */
    eits_real *row[EITS_SCRATCH_ROWS];     /* stride each */
    eits_real *pixel[EITS_SCRATCH_PIXELS]; /* n_pixels each */
    eits_real *square;                     /* rank x stride */
} eits_scratch;

struct eits_context {
    const eits_model *model;
    const eits_kernels *kernels;
    eits_options options;
    eits_info info; /* of the last frame; each stage fills in its fields */
    uint16_t *cell; /* ny x nx: which kept pixel a cell of the image is; EITS_NO_PIXEL for none */
    eits_columns columns;
    eits_reference reference;
    eits_rows rows;
    eits_frame frame;
    eits_projection projection;
    eits_whitening whitening;
    eits_range range;
    eits_solve_state solver;
    eits_touch_memory touch;
    eits_evidence evidence;
    eits_multipole multipole;
    eits_joint_memory joint;
    eits_scratch scratch;
};

/* Row i's electrodes, I+, I-, V+, V-. */
static inline const uint8_t *eits_row(const eits_context *ctx, uint32_t i)
{
    return ctx->model->protocol + 4 * (size_t)i;
}

#endif

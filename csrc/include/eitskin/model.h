/* eitskin: a view of an .eitm model, read in place (docs/reference/eitm-format.md specifies the
 * bytes).
 *
 * A model is everything that is known of a skin before the first frame: its protocol, the reduced
 * sensitivity S of its pixels, the matrix P that brings data into the same space, the pixels'
 * places, the fields for what touches do to each other, defaults, and one golden frame to test the
 * core with. It is made offline from a description of the skin (`eitskin model build`).
 *
 * Nothing is copied: the view points into the blob, which must stay where it is, unchanged, as long
 * as the view is used. Many contexts and threads may share one model. eits_model_open checks the
 * CRC, every length, index and number once, so that nothing has to be checked later; it reads the
 * whole blob, 0.3 MB as shipped. Sections that this version does not know are skipped.
 *
 * Names as in the format's page: m rows of the protocol, of which n_folded folds are left once
 * reciprocal rows are averaged; rank r; n pixels. P is r x n_folded, S is r x n.
 */
#ifndef EITSKIN_MODEL_H
#define EITSKIN_MODEL_H

#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A file of another major version is rejected; of a later minor one, what is new is skipped. */
#define EITS_MODEL_MAJOR          1
#define EITS_MODEL_MINOR          10
#define EITS_MODEL_ALIGNMENT      16
#define EITS_MAX_RANK             1024
#define EITS_MAX_PLACE_ROWS       32
#define EITS_MAX_MOVE_DEGREE      4
#define EITS_MAX_MOVE_TERMS       15 /* of that degree and below */
#define EITS_MAX_PIXELS           65535
#define EITS_MAX_ROWS             65535
#define EITS_MAX_MODEL_ITERATIONS 100000 /* of a model's own defaults; options may ask for more */

/* How the reduced Jacobian is stored. Integer types carry one scale per column. */
typedef enum eits_storage {
    EITS_STORAGE_F32 = 0,
    EITS_STORAGE_F16 = 1,
    EITS_STORAGE_I16 = 2,
    EITS_STORAGE_I8 = 3
} eits_storage;

/* What the solver's data are, from a frame v and the reference frame v0. */
typedef enum eits_data_kind {
    EITS_DATA_DIFFERENCE = 0, /* v - v0, in volts of the model */
    EITS_DATA_NORMALISED = 1, /* (v - v0) / v0: for channels that have gains of their own */
    /* v0 log(v / v0): the same sensitivity as a difference, straighter for strong touches */
    EITS_DATA_LOG_RATIO = 2
} eits_data_kind;

/* A matrix of `cols` columns of `rows` numbers each, column after column, `stride` numbers apart.
 * `stride` is `rows` rounded up to eight, filled with zeros, so that kernels read whole vectors.
 * Number i of column j is data[j stride + i], times scale[j] where there are scales. */
typedef struct eits_matrix {
    const void *data;   /* cols x stride numbers of `storage`, 16-byte aligned */
    const float *scale; /* one per column for integer storage, else NULL */
    uint32_t rows;
    uint32_t cols;
    uint32_t stride;
    eits_storage storage;
} eits_matrix;

/* The fields that the electrodes' currents make in the untouched skin, and the rim's mirror: for
 * what touches do to each other. */
typedef struct eits_fields {
    /* f16, a column a pixel: E_x of each electrode's current, E_y of each, then a_x, a_y, b_x,
     * b_y of the mirror (docs/reference/eitm-format.md, "FLDS"); data NULL where the model has
     * none */
    eits_matrix at;
    float volts;     /* dV = -volts change area E . E, in V per (S/m mm^2) */
    float per_sheet; /* 1 / (2 pi sigma): m/S */
} eits_fields;

/* One folded row: the mean of row `first` and, with `sign`, of its reciprocal `second`. What drives
 * and what measures may be exchanged (reciprocity), so the mean halves the noise's power; their
 * difference is an error of the instrument, a diagnostic. */
typedef struct eits_fold {
    uint16_t first;
    uint16_t second; /* EITS_FOLD_NONE where the table has no reciprocal */
    int16_t sign;    /* +1 or -1 */
    uint16_t reserved;
} eits_fold;
#define EITS_FOLD_NONE 0xFFFFu

/* Column and row of a kept pixel in the nx x ny image; row 0 is the lowest y. Pixels outside the
 * outline are not kept: images hold n_pixels numbers, not nx x ny. */
typedef struct eits_pixel {
    uint16_t ix;
    uint16_t iy;
} eits_pixel;

/* Defaults that the model's maker chose; eits_options_default() starts from them. */
typedef struct eits_defaults {
    uint32_t iterations;
    uint32_t max_touches;
    float lambda_rel;          /* lambda >= lambda_rel * lambda_max */
    float lambda_noise_factor; /* lambda >= lambda_noise_factor * lambda_noise */
    float detection_factor;    /* no touch where lambda_max < detection_factor * lambda_noise */
    float mask_threshold;      /* t of the mask x > t max(x), chosen on training scenes */
    float touch_threshold;     /* see eits_options for this and the following */
    float touch_min_fraction;
    float touch_min_radius_mm;
    float touch_max_radius_mm;
    float touch_seed_radius_mm;
    float touch_change_s_per_m;
    float follow_mm;
    float touch_radius_weight;
    uint32_t solver; /* eits_solver; files of format 1.0 have 0 here */
    /* bits of eits_touch_fit (options.h) that are not set by default, EITS_GAIN_DRIFT_KEPT and
     * EITS_TRACKS_REFERENCE;
     * files before 1.2 have 0 here */
    uint32_t touch_fit_left_out;
} eits_defaults;
/* By default changes along the reference frame are data like others: a taught model has learned
 * what drifts. From format 1.5. */
#define EITS_GAIN_DRIFT_KEPT   8u
/* By default the reference follows the untouched skin (options.reference_frames). From 1.5. */
#define EITS_TRACKS_REFERENCE 16u

/* The self-test inside a model: frames, and what a float32 solve with the defaults must give. A
 * board runs it before it believes an uploaded model. */
typedef struct eits_golden {
    const float *reference; /* n_rows, V */
    const float *frame;     /* n_rows, V */
    const float *image;     /* n_pixels, S/m, bits as the float32 core gives them */
    /* EITS_SELF_TEST_SUMS checksums of a set of frames (section SUMS); NULL: none of this core's */
    const uint32_t *sums;
} eits_golden;

/* Greatest table and polynomial of a calibration; a file with more is EITS_E_MODEL_VALUE. */
#define EITS_MAX_FORCE_POINTS 64
#define EITS_MAX_FORCE_ORDER  4

/* How strength and place of a touch tell its force: what a calibration with known weights found
 * (force.h). */
typedef struct eits_force_head {
    uint32_t points;   /* of the table, 2 to EITS_MAX_FORCE_POINTS */
    uint32_t order;    /* of the gain's polynomial, at most EITS_MAX_FORCE_ORDER */
    float radius_mm;   /* u = x / radius_mm, v = y / radius_mm */
    float reach;       /* sqrt(u^2 + v^2) of the outermost place that was calibrated */
    float uncertainty; /* of a force, relative: 95 % of those left out of the fit were within it */
    uint32_t reserved[3];
} eits_force_head;

/* The calibration of forces (section LOAD), as eits_force_n uses it. */
typedef struct eits_force {
    const eits_force_head *head; /* NULL: the model is not calibrated */
    const float *strength;       /* points, from 0 ascending: S/m mm^2 where the gain is 1 */
    const float *force_n;        /* points, from 0 ascending: N */
    /* (order + 1)(order + 2) / 2 coefficients: 1, u, v, u^2, u v, v^2... */
    const float *gain;
} eits_force;

/* How P and S were whitened, as the model says (section WHIT): P = diag(w) U', S = diag(s w) V',
 * w_i = (s_i^2 + mu s_1^2)^-1/2. By row of P, `rank` numbers each. */
typedef struct eits_row_form {
    const float *scale;    /* 1 / (w_i s_1); NULL: the model does not say how it was whitened */
    const float *strength; /* (s_i / s_1)^2 */
    const float *energy;   /* |P_i|^2 = w_i^2 */
    const float *square;   /* s_i^2 */
    float mu;
    float s1;        /* in the units of 1 / P */
    float s1_square; /* |S_1|^2 */
} eits_row_form;

/* What the model itself may be wrong by (section UNCE), in reduced data: second moments found
 * offline from skins that differ from the modelled one as real skins do
 * (docs/reference/eitm-format.md). Each is the lower triangle of a symmetric rank x rank matrix,
 * row after row. */
typedef struct eits_uncertainty {
    /* P E P', E that of (d_true - d_model) / |d_model| over touched skins, d the folded data;
     * NULL: the model does not say what it may be wrong by, and touches are not tested */
    const float *errors;
    const float *drift; /* P D P', D that of the data of a sheet that drifts untouched; V^2 */
    uint32_t row_gains; /* 1: errors are of data multiplied by row gains from the reference */
    float errors_rms;   /* |d_true - d_model| / |d_model|, rms: skins that differ */
    float shapes_rms;   /* the same: touches that are no discs */
    /* N, n_folded x place_rows, fold by fold, mm: |N'y|^2 is what the variance of a place grows by
     * on a skin whose reference differs from the model by y = log(v0 / v_ref) (section GEOM); NULL:
     * not known */
    const float *places;
    uint32_t place_rows; /* at most EITS_MAX_PLACE_ROWS */
    /* M, n_folded x move_rows, fold by fold, mm, and U, 2 x move_terms x move_rows, first along x,
     * then y: such a skin has a touch found off by the polynomial with coefficients U M'y, terms 1,
     * x, y, x^2, x y, y^2 ... with x and y from the grid's middle over half its longer side
     * (section MOVE); NULL: not known. And of y what no such skin has, n_folded x rest_rows: what
     * is there all the same is of rows with gains of their own */
    const float *moved, *moves, *rest;
    uint32_t move_rows, rest_rows; /* at most EITS_MAX_PLACE_ROWS */
    uint32_t move_terms;           /* 1, 3, 6, 10 or EITS_MAX_MOVE_TERMS; 0: none */
} eits_uncertainty;

/* An open model. All pointers go into the blob; a caller reads it and never writes it. */
typedef struct eits_model {
    uint32_t n_electrodes; /* electrodes that the protocol's table counts from 0 */
    uint32_t n_rows;       /* rows of the protocol table: voltages in a frame */
    uint32_t n_folded;     /* after the reciprocity fold */
    uint32_t rank;         /* rows of the reduced Jacobian */
    uint32_t n_pixels;     /* kept pixels: length of images and coefficients */
    /* columns and rows of the grid that they lie in; cells off the skin are not kept */
    uint32_t nx, ny;
    eits_data_kind data_kind;
    float pixel_mm;                 /* width and height of a pixel */
    float origin_x_mm, origin_y_mm; /* lower left corner of pixel (0, 0) */
    float current_a;                /* drive current that v_ref was modelled with, A */
    float lipschitz; /* at least the greatest eigenvalue of S'S as stored, and 2^-126 */
    /* max over pixels of the deviation of (S'P n)_j for unit white noise n on the folded rows */
    float noise_gain;
    uint64_t protocol_hash;
    const uint8_t *protocol; /* n_rows x 4: I+, I-, V+, V- */
    /* n_rows each: the rows in the order that they are measured, and when each one is, from 0
     * (section ORDR); NULL: as they stand */
    const uint16_t *scan_order, *scan_place;
    const eits_fold *fold; /* n_folded */
    /* n_folded: boundary voltage of the untouched skin as modelled, V */
    const float *v_ref;
    eits_matrix reduction;      /* P: rank x n_folded, whitened data y = P d; always f32 */
    eits_matrix sensitivity;    /* S: rank x n_pixels, the reduced Jacobian */
    const float *column_weight; /* n_pixels: image_j = coefficient_j * column_weight_j, in S/m */
    eits_fields fields;
    const eits_pixel *pixel; /* n_pixels, ordered by iy, then ix */
    const eits_defaults *defaults;
    eits_golden golden;
    eits_force force;
    eits_row_form row_form;
    eits_uncertainty uncertainty;
    /* n_folded (n_folded + 1) / 2, the lower triangle of R by rows: the inverse of the covariance
     * of the rows' noise that P whitens, P R^-1 P' = I (section PREC of taught models); NULL: none
     */
    const float *precision;
    /* what the covariance of a place by the fit's normal equations is multiplied by (section PLAC
     * of taught models); 0: places are not rated so */
    float place_factor;
    const char *meta; /* JSON, not terminated by 0; NULL if absent */
    uint32_t meta_size;
} eits_model;

/* Check `blob` wholly and fill `model` with pointers into it. `blob` must start at a multiple of 16
 * bytes (EITS_MODEL_ALIGNMENT); `size` may be larger than the model, as a flash bank is.
 * Errors: EITS_E_ARGUMENT, EITS_E_MODEL_*; `model` is untouched then. */
eits_status eits_model_open(eits_model *model, const void *blob, size_t size);

/* What names a protocol: the firmware compares it with that of the table it scans, so that a model
 * is never fed with another order of rows. FNV-1a, 64 bits, over n_electrodes and n_rows as
 * little-endian u16 and the table's bytes. */
uint64_t eits_protocol_hash(uint32_t n_electrodes, uint32_t n_rows, const uint8_t *table);

/* CRC-32 (reflected 0xEDB88320, as in zlib) of `size` bytes, continuing from `crc` (0 to start). */
uint32_t eits_crc32(uint32_t crc, const void *bytes, size_t size);

#ifdef __cplusplus
}
#endif
#endif

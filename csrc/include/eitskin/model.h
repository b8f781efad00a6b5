/* eitskin: a view of an .eitm model, read in place (docs/reference/eitm-format.md specifies the
 * bytes).
 *
 * A model holds everything that is known about a skin before the first frame: its protocol, the
 * reduced sensitivity S of its pixels, the matrix P that brings data into the same space, the
 * pixels' places, the fields from which the interaction of touches is computed, default options,
 * and one golden frame to test the core with. `eitskin model build` makes it from a description of
 * the skin.
 *
 * Nothing is copied: the view points into the blob, which must stay in place, unchanged, as long as
 * the view is used. Many contexts and threads may share one model. eits_model_open checks the CRC
 * and every length, index and number once, so that nothing has to be checked later. It reads the
 * whole blob, 0.37 MB for the shipped skin. Sections that this version does not know are skipped.
 *
 * Dimensions, as in the format's page: the protocol has n_rows rows; averaging reciprocal rows
 * leaves n_folded folded rows. P is rank x n_folded, S is rank x n_pixels.
 */
#ifndef EITSKIN_MODEL_H
#define EITSKIN_MODEL_H

#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A file of another major version is rejected. In a file of a later minor version, new sections are
 * skipped. */
#define EITS_MODEL_MAJOR          1
#define EITS_MODEL_ALIGNMENT      16
#define EITS_MAX_RANK             1024
#define EITS_MAX_PLACE_ROWS       32
#define EITS_MAX_MOVE_DEGREE      4
#define EITS_MAX_MOVE_TERMS       15 /* terms of that degree and below */
#define EITS_MAX_PIXELS           65535
#define EITS_MAX_ROWS             65535
#define EITS_MAX_MODEL_ITERATIONS 100000 /* of a model's defaults; options may ask for more */

/* How the reduced Jacobian is stored. Integer types carry one scale per column. */
typedef enum eits_storage {
    EITS_STORAGE_F32 = 0,
    EITS_STORAGE_F16 = 1,
    EITS_STORAGE_I16 = 2,
    EITS_STORAGE_I8 = 3
} eits_storage;

/* How the solver's data are computed from a frame v and the reference frame v0. */
typedef enum eits_data_kind {
    EITS_DATA_DIFFERENCE = 0, /* v - v0, in volts of the model */
    EITS_DATA_NORMALISED = 1, /* (v - v0) / v0: for rows that have gains of their own */
    /* v0 log(v / v0): the same sensitivity as a difference, more nearly linear for strong touches
     */
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

/* The fields that the electrodes' currents make in the untouched skin, and how the rim mirrors a
 * dipole. The interaction of touches is computed from them. */
typedef struct eits_fields {
    /* f16, one column per pixel: E_x of each electrode's current, E_y of each, then a_x, a_y, b_x,
     * b_y of the mirror (docs/reference/eitm-format.md, "FLDS"); data is NULL if the model has none
     */
    eits_matrix at;
    float volts;     /* dV = -volts change area E . E, in V per (S/m mm^2) */
    float per_sheet; /* 1 / (2 pi sigma): m/S */
} eits_fields;

/* One folded row: the mean of row `first` and, with `sign`, of its reciprocal `second`. By
 * reciprocity the driving and the measuring pair may be exchanged, so the mean halves the noise's
 * power. The difference of the two is an error of the instrument, and serves as a diagnostic. */
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
    /* the bits of eits_touch_fit (options.h) that are not set by default; EITS_GAIN_DRIFT_KEPT;
     * EITS_TRACKS_REFERENCE. Files before 1.2 have 0 here */
    uint32_t touch_fit_left_out;
} eits_defaults;
/* By default changes along the reference frame count as data (options.project_reference is 0): a
 * taught model has learned what drifts. From format 1.5. */
#define EITS_GAIN_DRIFT_KEPT  8u
/* By default the reference follows the untouched skin (options.reference_frames). From 1.5. */
#define EITS_TRACKS_REFERENCE 16u

/* The self-test inside a model: frames, and the results that a float32 solve with the defaults must
 * give. A board runs it before it uses an uploaded model. */
typedef struct eits_golden {
    const float *reference; /* n_rows, V */
    const float *frame;     /* n_rows, V */
    const float *image;     /* n_pixels, S/m: the float32 core's result, bit for bit */
    /* EITS_SELF_TEST_SUMS checksums of a set of frames (section SUMS); NULL: none, or those of
     * another EITS_SELF_TEST_REVISION */
    const uint32_t *sums;
} eits_golden;

/* The largest table and polynomial of a calibration. A file with more gives EITS_E_MODEL_VALUE. */
#define EITS_MAX_FORCE_POINTS 64
#define EITS_MAX_FORCE_ORDER  4

/* How the force follows from a touch's strength and place, found by a calibration with known
 * weights (force.h). */
typedef struct eits_force_head {
    uint32_t points;   /* of the table, 2 to EITS_MAX_FORCE_POINTS */
    uint32_t order;    /* of the gain's polynomial, at most EITS_MAX_FORCE_ORDER */
    float radius_mm;   /* u = x / radius_mm, v = y / radius_mm */
    float reach;       /* sqrt(u^2 + v^2) of the outermost place in the calibration */
    float uncertainty; /* relative error of a force: 95 % of held-out presses were within it */
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

/* How P and S were whitened, from section WHIT: P = diag(w) U', S = diag(s w) V', w_i = (s_i^2 + mu
 * s_1^2)^-1/2. Each array has `rank` numbers, one per row of P. */
typedef struct eits_row_form {
    const float *scale;    /* 1 / (w_i s_1); NULL: the model does not state how it was whitened */
    const float *strength; /* (s_i / s_1)^2 */
    const float *energy;   /* |P_i|^2 = w_i^2 */
    const float *square;   /* s_i^2 */
    float mu;
    float s1;        /* in the units of 1 / P */
    float s1_square; /* |S_1|^2 */
} eits_row_form;

/* The errors of the model itself, in reduced data (section UNCE): second moments, computed offline
 * from simulated skins that differ from the modelled one as real skins do
 * (docs/reference/eitm-format.md). Each is the lower triangle of a symmetric rank x rank matrix,
 * row after row. */
typedef struct eits_uncertainty {
    /* P E P', where E is the second moment of (d_true - d_model) / |d_model| over touched skins,
     * and d the folded data. NULL: the errors are not known, and touches are not tested */
    const float *errors;
    const float *drift; /* P D P', where D is the second moment of the data of an untouched skin
                           that drifts; V^2 */
    uint32_t
        row_gains; /* 1: the errors are those of data multiplied by row gains from the reference */
    float errors_rms; /* rms of |d_true - d_model| / |d_model| over skins that differ */
    float shapes_rms; /* the same over touches that are not discs */
    /* N, n_folded x place_rows, fold by fold, mm (section GEOM). On a skin whose reference differs
     * from the model's by y = log(v0 / v_ref), the variance of a place is larger by |N'y|^2. NULL:
     * not known */
    const float *places;
    uint32_t place_rows; /* at most EITS_MAX_PLACE_ROWS */
    /* `moved` is M, n_folded x move_rows, fold by fold, mm; `moves` is U, 2 x move_terms x
     * move_rows, first along x, then along y (section MOVE). On such a skin a touch is found
     * displaced by the polynomial with the coefficients U M'y and the terms 1, x, y, x^2, x y, y^2
     * ..., where x and y are measured from the grid's middle, over half its longer side. NULL: not
     * known. `rest`, n_folded x rest_rows, spans the part of y that no such skin has; a y with that
     * part comes from rows that have gains of their own */
    const float *moved, *moves, *rest;
    uint32_t move_rows, rest_rows; /* at most EITS_MAX_PLACE_ROWS */
    uint32_t move_terms;           /* 1, 3, 6, 10 or EITS_MAX_MOVE_TERMS; 0: none */
} eits_uncertainty;

/* The model errors on folded rows, for the joint fit of touches, which works on these rows (section
 * ROWE). */
typedef struct eits_row_errors {
    /* e_1 ... e_count, n_folded x count, fold by fold: where y = log(v0 / v_ref) has the rms
     * `distance`, the second moment of (d_true - d_model) / |d_model| is the sum of e e'. NULL: not
     * known */
    const float *vectors;
    uint32_t count; /* at most EITS_MAX_PLACE_ROWS */
    float distance;
    /* M and U as in eits_uncertainty, with its move_terms: U for touches fitted in white noise, and
     * for touches fitted with these errors */
    const float *moved, *moves[2];
    uint32_t move_rows; /* at most EITS_MAX_PLACE_ROWS */
} eits_row_errors;

/* An open model. All pointers go into the blob; a caller reads it and never writes it. */
typedef struct eits_model {
    uint32_t n_electrodes; /* the protocol's table counts them from 0 */
    uint32_t n_rows;       /* rows of the protocol's table: the voltages of a frame */
    uint32_t n_folded;     /* rows that are left when reciprocal rows are averaged */
    uint32_t rank;         /* rows of P and S: numbers of a frame's reduced data */
    uint32_t n_pixels;     /* pixels on the skin: the length of images and coefficients */
    uint32_t nx, ny;       /* columns and rows of the grid in which the pixels lie */
    eits_data_kind data_kind;
    float pixel_mm;                 /* width and height of a pixel */
    float origin_x_mm, origin_y_mm; /* lower left corner of pixel (0, 0) */
    float current_a;                /* drive current that v_ref was modelled with, A */
    float lipschitz; /* at least the greatest eigenvalue of S'S as stored, and at least 2^-126 */
    /* the maximum over pixels j of the standard deviation of (S'P n)_j, where n is white noise of
     * variance 1 on the folded rows */
    float noise_gain;
    uint64_t protocol_hash;
    const uint8_t *protocol; /* n_rows x 4: I+, I-, V+, V- */
    /* n_rows each (section ORDR): scan_order lists the rows in the order in which they are
     * measured; scan_place is each row's place in that order, from 0. NULL: the order of the table
     */
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
    eits_row_errors row_errors;
    /* n_folded (n_folded + 1) / 2: the lower triangle, by rows, of the inverse R of the covariance
     * of the rows' noise; P whitens that noise, P R^-1 P' = I (section PREC of taught models).
     * NULL: not known */
    const float *precision;
    /* a place's covariance is the fit's, from its normal equations, times this factor (section PLAC
     * of taught models); 0: the model does not rate places in this way */
    float place_factor;
    const char *meta; /* JSON, not terminated by 0; NULL if absent */
    uint32_t meta_size;
} eits_model;

/* Check all of `blob`, which has `size` bytes, and fill `model` with pointers into it. `blob` must
 * start at a multiple of EITS_MODEL_ALIGNMENT bytes. `size` may be larger than the model, as the
 * size of a flash bank is. Errors: EITS_E_ARGUMENT, EITS_E_MODEL_*; `model` is then unchanged.
 * EITS_E_MODEL_VALUE also if the model names a solver that this library does not have (options.h).
 */
eits_status eits_model_open(eits_model *model, const void *blob, size_t size);

/* The hash that identifies a protocol. The firmware compares the model's with that of the table
 * which it scans, so that a model never gets rows in another order. FNV-1a, 64 bits, over
 * n_electrodes and n_rows as little-endian u16 and the table's bytes. */
uint64_t eits_protocol_hash(uint32_t n_electrodes, uint32_t n_rows, const uint8_t *table);

/* CRC-32 (reflected 0xEDB88320, as in zlib) of `size` bytes, continuing from `crc` (0 to start). */
uint32_t eits_crc32(uint32_t crc, const void *bytes, size_t size);

#ifdef __cplusplus
}
#endif
#endif

/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_FRAME_CONSTANTS_H
#define EITSKIN_FRAME_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: row gains: the distance was found after looking at a measured tank and at uneven
 * skins. Study constants, of 1459 frames: MAX_DISTANCE at half loses 4 exact ones and adds 6 false
 * diagnostics, at double nothing; MAX_ROW_GAIN at half adds 2; ROW_SPREAD changes neither.
 * MAX_RECIPROCITY is a guard against other instruments (test_seek). Check: eitskin study constants
 * --data FOLDER */

/* no row's data are scaled up or down by more than this factor. larger: a row of little voltage
 * counts too much; smaller: uneven sheets stay uneven */
#define EITS_MAX_ROW_GAIN R(3.0)

/* row gains are off if the reference is further from the model: the instrument then differs from it
 * [rms log ratio]. larger: harm on instruments that differ; smaller: off on very uneven sheets */
#define EITS_MAX_DISTANCE R(0.28)

/* row gains are off if rows differ from their reciprocals by more [of the reference's rms]. as
 * MAX_DISTANCE */
#define EITS_MAX_RECIPROCITY R(0.1)

/* if single rows' gains differ by this much, places are corrected by a quarter [rms log ratio].
 * larger: an instrument's gains move touches; smaller: misplaced electrodes do */
#define EITS_ROW_SPREAD R(0.03)

/* ---- Chosen: by the arithmetic: half a unit in the last place of two float32 voltages, and some.
 * Check: ctest --preset host -R frame_f */

/* frames without noise still have this rounding; it is float32's in either width, so that both
 * builds use the same [of v0_rms]. larger: light touches of very quiet front ends are missed;
 * smaller: touches of rounding */
#define EITS_NOISE_ROUNDING R(2.384185791015625e-07)

/* max(S'y) of white noise, over the deviation of the pixel with the most noise [deviations]. as
 * NOISE_ROUNDING */
#define EITS_MAX_OF_NOISE R(3.5)

/* ---- Chosen: on tares of 4 to 1024 frames at 40, 60 and 80 dB, with 16 single touches of radius 5
 * to 10 mm and contrast 1.5 to 8 that land, lift, tap or rise within them (seed 5), and on the
 * untouched frames of the library's scenes: largest ratio 1.13 (a gel that dries), largest common
 * part .024 % of the reference. Check: scripts/test tests/python/solve/test_tare_touched.py */

/* a reference is touched if the common part of the changes of reciprocal rows exceeds their
 * difference by more than chance gives [deviations]. larger: touches at 40 dB go unnoticed;
 * smaller: noise is taken for a touch */
#define EITS_MOVED_DEVIATIONS R(5.0)

/* and so much, rms [of the reference]. larger: light touches go unnoticed; smaller: skins that dry
 * or warm up are refused */
#define EITS_MOVED_FRACTION R(0.001)

/* and so much [of the option noise_floor_v]. larger: light touches go unnoticed; smaller: rounding
 * without noise is taken for a touch */
#define EITS_MOVED_STEPS R(4.0)

/* ---- Chosen: guards: a touch changes a row by less. Study constants: MAX_RATIO changes 6 scenes
 * with faults and no exact frame, RATIO_DEFINED nothing. Check: ctest --preset host -R frame_f */

/* v / v0 is kept within this factor of 1 before the logarithm. larger: one bad row outweighs all
 * others in the log data; smaller: bends what strong touches do */
#define EITS_MAX_RATIO R(16.0)

/* the ratio of a row with a smaller reference has no meaning [of the reference's rms]. larger:
 * leaves out small rows that are good; smaller: divides by noise */
#define EITS_RATIO_DEFINED R(1e-06)

/* ---- Chosen: by the arithmetic: FOLD_ROUNDING is 16 times the rounding of one voltage, 2^-24
 * (2^-53); BASIS_TOLERANCE a guard. Study constants: neither changes an exact frame or a
 * diagnostic. Check: ctest --preset host -R outliers */

/* a row and its reciprocal count as equal if they differ by less [of the reference]. larger:
 * outliers of quantised voltages are overlooked; smaller: copied reciprocals seem to be measured */
#define EITS_FOLD_ROUNDING R(sizeof(eits_real) == 4 ? 0x1p-20 : 0x1p-49)

/* a direction joins the basis if more of it than this remains beside the basis [of its square].
 * larger: ignores less than asked; smaller: takes rounding as a direction and ignores data */
#define EITS_BASIS_TOLERANCE R(1e-06)

/* ---- Chosen: on training scenes with one to three electrodes out, NOISE_POWER on masks of one row
 * to three electrodes; their seeds were not kept. Check: scripts/test
 * tests/python/acceptance/test_rows_left_out.py */

/* if rows are left out, mu falls with this power of the fraction that remains. larger: noise of the
 * weak directions; smaller: a blurred image beside the electrode */
/* REST_POWER = 3, in the source as left * left * left */

/* if rows are left out, mu does not fall below this [of the model's mu]. larger: blurs where many
 * rows are out; smaller: lets their noise through */
#define EITS_MIN_REGULARISATION_FRACTION R(0.1)

/* if rows are left out, max(S'y) of noise grows with this power of its rms. larger: misses faint
 * touches then; smaller: shows noise as touches */
/* NOISE_POWER = 1.25, in the source as ratio sqrt(sqrt(ratio)) */

/* ---- Chosen: for what float32 needs. Study constants, of 1459 frames: STEP_MARGIN at double loses
 * 10 exact ones; MAX_REGULARISATION at half removes 3 false diagnostics of an instrument unlike its
 * model; LOST, NOISE_PROBES and all the other values lose none. MIN_REGULARISATION is a guard that
 * no scene and no test reaches. Check: ctest --preset host -R masked_whitening */

/* minimum of mu if rows are left out [of s_1^2]. larger: blurs; smaller: the factor of float32
 * breaks down */
#define EITS_MIN_REGULARISATION R(0.0001)

/* maximum of mu for a noisy reference: beyond it, directions weigh as they are measured [of s_1^2].
 * larger: changes little; smaller: noisy boards keep noise */
#define EITS_MAX_REGULARISATION R(1.0)

/* a direction that no row sees is held to zero with this weight [of mu]. larger: biases directions
 * that are seen; smaller: the factor's pivots are rounding */
#define EITS_LOST R(0.01)

/* F stays this far below the stated Lipschitz constant [of |S_1|^2]. larger: rounding may exceed
 * the constant and FISTA rises; smaller: shorter steps */
#define EITS_STEP_MARGIN R(0.995)

/* number of sign vectors that estimate the noise in S'F'y [sign vectors]. larger: each costs two
 * triangles when rows change; smaller: a rougher lambda_noise. They are orthogonal within each
 * eight directions */
#define EITS_NOISE_PROBES 8

/* ---- Chosen: REFERENCE_TRACKING_TOUCH on the streams of DRIFT_UNEXPLAINED: false touches stop the
 * reference in five of seven with .6, in one with .7, in none from .75 on; measured presses have
 * .83 and more (95 %); at half 84 exact frames of 1459 are lost (study constants). The others
 * change none at half and at double; REFERENCE_TRACKING_LEFT is a guard. Check: eitskin study
 * teaching --data FOLDER */

/* a tracked reference moves by one over this number at once, after reference_frames over this
 * number. larger: follows a touch sooner after it is lifted; smaller: goes further on one mean */
#define EITS_REFERENCE_TRACKING_PARTS 16

/* a mean difference looks like a touch, and is not tracked, if one column explains more of it [of
 * |y|^2]. larger: light touches are followed; smaller: drift at one place is not */
#define EITS_REFERENCE_TRACKING_TOUCH R(0.75)

/* a larger change of gain at once, under touches, is not tracked [of the reference]. larger: what a
 * hand does may count; smaller: fast drying is not followed */
#define EITS_REFERENCE_TRACKING_GAIN R(0.02)

/* the reference, and each touch's column, must keep more than this beside the columns of the
 * touches [of its square]. larger: gives up near many touches; smaller: rounding tells the gain */
#define EITS_REFERENCE_TRACKING_LEFT R(0.01)

/* clang-format on */

#endif

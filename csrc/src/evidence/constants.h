/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_EVIDENCE_CONSTANTS_H
#define EITSKIN_EVIDENCE_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: in a prototype, out of about 45 configurations, on scenes of its own; confirmed on
 * the tuning family of the worlds (seed 1, 40 scenes a set). Check: eitskin bench worlds */

/* a disc is a touch if minus twice the log-likelihood, divided by its excess, rises by more than
 * this without the disc. larger: true touches are dropped; smaller: false ones stay */
#define EITS_TOUCH_EVIDENCE R(20.0)

/* fraction of the errors' second moment in the covariance: the part that remains after places and
 * radii have adapted [of |d|^2]. larger: light and near touches are dropped; smaller: model errors
 * become touches */
#define EITS_ERROR_SHARE R(0.25)

/* least standard deviation of a row's noise [of v0_rms]. larger: light touches are dropped;
 * smaller: a noiseless reference makes touches */
#define EITS_ERROR_MIN_NOISE R(0.0001)

/* prior precision of a touch's radius and edge terms: a standard deviation of .3 of the radius [1 /
 * deviation^2]. larger: ellipses become two touches; smaller: two near touches become one long
 * one */
#define EITS_SHAPE_PRECISION R(11.111111)

/* prior precision of its dipole terms: a standard deviation of .2 of the disc's dipole [1 /
 * deviation^2]. as SHAPE_PRECISION */
#define EITS_DIPOLE_PRECISION R(25.0)

/* Gauss-Newton steps for each simpler answer [steps]. larger: more work; smaller: an answer is
 * compared before it is fitted */
#define EITS_REFIT_STEPS 5

/* cost per disc of F without slopes, counted in test_columns [columns]. larger: less is tried;
 * smaller: a frame costs more than test_columns says */
#define EITS_TRIAL_COLUMNS 2

/* the test of touches computes no further columns after so many [multiply-accumulates per fold].
 * larger: less is left for the joint fit of the tested touches; smaller: more frames are crowded */
#define EITS_TEST_WORK 30000

/* cost of a column, above the rank [multiply-accumulates over the rank]: at rank 64 columns take
 * 4,000 to 8,700, with all that the test computes beside them [numbers]. larger: less is tried;
 * smaller: a frame costs more than TEST_WORK says */
#define EITS_COLUMN_ROWS 48

/* ---- Chosen: on the tuning family of the worlds (seeds 21 and 22, 100 scenes a set): 1.5 of 1.5,
 * 2 and 3 gives the most right counts, and the fewest right counts that are called crowded. Check:
 * eitskin study belief */

/* discs with a greater rise are believed without another fit [of the threshold]. larger: more work,
 * and more frames are crowded; smaller: the linearisation alone decides */
#define EITS_CLEAR R(1.5)

/* ---- Chosen: on the tuning family of the worlds (seed 1, 40 scenes a set): true touches of discs
 * rise by at least 26 thresholds, false ones elsewhere by up to 36, where the excess is above 2.
 * Check: eitskin bench worlds */

/* up to this excess at the first look, the test continues without examining whether the skin has
 * drifted. larger: drift becomes touches; smaller: more work */
#define EITS_FITS_AS_DISCS R(4.0)

/* up to this excess of the remaining discs, a drift of the skin is not considered. larger: drift
 * becomes touches; smaller: more work */
#define EITS_FITS R(2.0)

/* ---- Chosen: study constants, exact frames of 1459 lost at half and at double: LEAST_CHANGE 5 and
 * 0, SHORTER 2 and 4, MOST_CHANGE 3 and 1, MAX_MOVE 2 and 2, MAX_RADIUS_MOVE 0 and 1, the others
 * none. Check: eitskin study constants --data FOLDER */

/* least number of degrees of freedom after each disc has taken four [data]. larger: the excess of
 * crowds is too small; smaller: it is all rounding */
#define EITS_MIN_FREEDOM R(8.0)

/* prior precision of strength and place, against rounding only: they have no prior. larger: holds
 * light touches back; smaller: a disc without effect has no inverse */
#define EITS_FREE_PRECISION R(0.0001)

/* least pivot of a factor [of a diagonal element]. larger: near discs are held apart; smaller: a
 * root of rounding */
#define EITS_MIN_PIVOT R(1e-05)

/* the longest step of a strength downwards [of the strength]. nearer 0: more steps; further from 0:
 * a touch changes its sign */
#define EITS_LEAST_CHANGE R(-0.5)

/* the longest step of a strength upwards [of the strength]. larger: overshoots; smaller: more
 * steps */
#define EITS_MOST_CHANGE R(1.0)

/* the longest step of a place [pixels]. larger: leaves the range of the slopes; smaller: more
 * steps */
#define EITS_MAX_MOVE R(1.0)

/* the longest step of a radius [pixels]. as MAX_MOVE */
#define EITS_MAX_RADIUS_MOVE R(0.5)

/* a step that promises less is not made [of F]. larger: fits end early; smaller: more work */
#define EITS_SETTLED_MISFIT R(1.0)

/* after a step that did not lower the misfit, a step of this length is tried. larger: more steps
 * that are too long; smaller: steps without effect */
#define EITS_SHORTER R(0.4)

/* ---- Chosen: on the tuning family of the worlds (seed 1, 40 scenes a set): the smallest of 40 to
 * 64 that loses no right count. Check: eitskin bench worlds */

/* discs get shapes up to this number of columns of all discs [columns]. larger: more work in
 * crowds; smaller: odd shapes in crowds become touches */
#define EITS_SHAPE_COLUMNS 48

/* ---- Chosen: on the tuning family of the worlds (seeds 1 and 2): logistic regression of found
 * touches, true or false, on the logarithm of their rise; factors and floor of places (seeds 21 and
 * 22, 100 scenes per set) so that 90 % ellipses cover 87 to 93 % in as many sets as possible.
 * Check: eitskin study belief */

/* at this rise, half of the discs are touches [rise]. larger: every touch is less certain */
#define EITS_CONFIDENCE_HALF R(11.0)

/* factor of the covariance of a place by the linearisation. larger: ellipses of light touches cover
 * more */
#define EITS_PLACE_FACTOR R(0.6)

/* factor of the displacement by one further step of the test; the squared product is added to the
 * covariance of a place. larger: ellipses of near touches cover more */
#define EITS_PLACE_APART R(3.0)

/* added to both variances of a place, for errors that no linearisation shows [pixels^2]. larger:
 * ellipses of clear touches cover more */
#define EITS_PLACE_MIN R(0.0007)

/* fraction of the variance that remains after the correction of places by the reference. larger:
 * ellipses cover more on skins whose electrodes lie elsewhere */
#define EITS_PLACE_GEOMETRY R(0.65)

/* added to both variances per unit of the reference's distance from the model's, if places are not
 * corrected [pixels^2]. larger: ellipses cover more on skins unlike their model */
#define EITS_PLACE_DISTANCE R(0.2)

/* ---- Chosen: on the tuning family of the worlds: logistic regression of touches that are two
 * fingers 12 to 16 mm apart (seed 2, 200 scenes) against single touches of all sets; the limits are
 * such that fewer than 5 % of the frames of clean discs and of fingers are crowded. Check: eitskin
 * study belief */

/* constant of the score [log odds]. larger: more touches may be two */
#define EITS_PAIR_OFFSET R(-3.12)

/* coefficient of the edge's bulge over its standard deviation. further from 0: it counts for
 * more */
#define EITS_PAIR_BULGE R(1.62)

/* coefficient of the dipole's part along the bulge over its standard deviation. as PAIR_BULGE */
#define EITS_PAIR_DIPOLE R(-0.53)

/* coefficient of bulge times dipole. as PAIR_BULGE */
#define EITS_PAIR_BOTH R(-36.43)

/* coefficient of the radius's growth. as PAIR_BULGE */
#define EITS_PAIR_GROWTH R(12.61)

/* coefficient of the square of that growth. as PAIR_BULGE */
#define EITS_PAIR_GROWTH_2 R(-30.31)

/* a touch with a greater score may be two, and the frame is crowded [log odds]. larger: fewer
 * frames are crowded */
#define EITS_PAIR_ODDS R(1.0)

/* a touch with a greater score is tried as two [log odds]. larger: two fingers stay one touch;
 * smaller: more work */
#define EITS_SPLIT_ODDS R(0.0)

/* F must fall by this if one touch becomes two, at even odds [of the threshold]. larger: two
 * fingers stay one touch; smaller: long fingers become two */
#define EITS_SPLIT_RISE R(4.0)

/* minus this for each unit of the log odds [of the threshold, for each of log odds]. as
 * PAIR_BULGE */
#define EITS_SPLIT_RISE_OF_ODDS R(0.75)

/* but F must fall by at least this [of the threshold]. as SPLIT_RISE */
#define EITS_SPLIT_MIN_RISE R(0.4)

/* two discs are given up unless the linearisation after the first steps predicts an F below this
 * [of F of one]. larger: more work; smaller: two fingers stay one touch */
#define EITS_SPLIT_HOPE R(2.0)

/* touches are tried as two while fewer columns of test_columns are used; later it mostly fails
 * [columns]. larger: more work; smaller: two fingers stay one touch */
#define EITS_SPLIT_COLUMNS 120

/* distance of the two first places from the middle [of the radius]. further from it: the fit may
 * end elsewhere */
#define EITS_SPLIT_APART R(0.75)

/* a touch with less confidence may be false, and the frame is crowded. larger: more frames are
 * crowded */
#define EITS_MIN_CONFIDENCE R(0.7)

/* ---- Chosen: guards against rounding: at half and at double one scene changes, by its
 * multiply-accumulates (study constants). Check: ctest --preset host -R evidence */

/* least variance of a shape's term. larger: precise shapes count for less */
#define EITS_PAIR_MIN_VARIANCE R(1e-06)

/* least bulge that has a direction [of the radius]. larger: the dipole counts for less */
#define EITS_PAIR_MIN_BULGE R(0.001)

/* clang-format on */

#endif

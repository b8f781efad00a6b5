/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_DIAGNOSTICS_CONSTANTS_H
#define EITSKIN_DIAGNOSTICS_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on 64 scenes of one to three touches, contacts +-20 %, 40, 60 and 80 dB, full and
 * half scans, seeds 77 and 177 (docs/reference/diagnostics.md); which number on which seed was not
 * kept. Check: eitskin bench diagnostics --seed 4001 */

/* least reference of a row that tells whether an electrode lives [of the reference's rms]. larger:
 * too few rows tell; smaller: rows that are small by geometry look dead */
#define EITS_ROW_SIGNIFICANT R(0.3)

/* and so many times what makes a row dead by noise [of ROW_DEAD_NOISE's limit]. larger: too few
 * rows tell on noisy boards; smaller: noise makes a row look dead */
#define EITS_ROW_SIGNIFICANT_NOISE R(10.0)

/* a row with less is dead [of the reference]. larger: a strong touch beside an electrode opens it;
 * smaller: leakage of an open electrode hides it */
#define EITS_ROW_DEAD_FRACTION R(0.02)

/* a row with less is dead [noise_v]. larger: too few rows tell; smaller: noise of an open electrode
 * looks alive */
#define EITS_ROW_DEAD_NOISE R(5.0)

/* so many must agree on an electrode or a pair; so many turned ones are a mismatch [rows]. larger:
 * electrodes with few rows are never named; smaller: two chance faults name one */
#define EITS_ROWS_TO_JUDGE 3

/* a row with more cannot be right [of the reference]. larger: broken amplifiers pass; smaller:
 * strong touches are left out */
#define EITS_ROW_GROWN R(8.0)

/* and a smaller reference counts as this [of the reference's rms]. larger: outliers of small rows
 * pass; smaller: rows near zero are left out */
#define EITS_ROW_SMALL R(0.05)

/* reciprocals may differ by so much of what noise gives [deviations]. larger: outliers stay in the
 * image; smaller: noise leaves good rows out */
#define EITS_OUTLIER_NOISE R(6.5)

/* the same where no noise was learned, by all differences of the frame [robust deviations]. as
 * OUTLIER_NOISE */
#define EITS_OUTLIER_ROBUST R(16.0)

/* and by so much: common modes scale with it [of the largest datum]. larger: outliers of small
 * touches stay; smaller: common modes leave rows out */
#define EITS_OUTLIER_LARGEST R(0.03)

/* and by so much: channel gains that differ scale with the change [of the larger side]. larger:
 * outliers stay; smaller: unequal channels lose rows */
#define EITS_OUTLIER_FRACTION R(0.25)

/* the side stays that is at most so many times as far from what the others predict. larger: the
 * wrong side may stay; smaller: both go, and a good row is lost */
#define EITS_OUTLIER_NEARER R(0.5)

/* more are no outliers [folds]. larger: a noisy electrode is taken apart row by row; smaller: it is
 * named too soon */
#define EITS_OUTLIER_MAX 8

/* below it the others predict nothing of this one [of a fold]. larger: fewer are predicted;
 * smaller: predictions by rounding */
#define EITS_OUTLIER_PIVOT R(0.05)

/* of the prediction [of the greatest s^2]. larger: predicts too little of strong touches; smaller:
 * predicts noise */
#define EITS_OUTLIER_RIDGE R(0.0001)

/* without reciprocals: of the prediction errors [robust deviations]. larger: outliers of half scans
 * stay; smaller: touches of odd shape lose rows */
#define EITS_OUTLIER_UNPAIRED R(16.0)

/* is in that fold [of what is not predicted]. as OUTLIER_UNPAIRED */
#define EITS_OUTLIER_ENERGY R(0.5)

/* share a noisy electrode [of the flagged folds]. larger: noisy electrodes become mismatches;
 * smaller: blames an electrode for others */
#define EITS_NOISY_FRACTION R(0.9)

/* outside the model's range [of |d|]. larger: swapped wires pass; smaller: contacts that differ are
 * reported */
#define EITS_MISMATCH_FRACTION R(0.05)

/* and so much of what noise leaves there [deviations]. larger: as above on noisy boards; smaller:
 * noise is reported */
#define EITS_MISMATCH_NOISE R(3.0)

/* the change against the sign rule [of lambda_max]. larger: a reference with a touch in it goes
 * unnoticed; smaller: ripple beside a touch is reported */
#define EITS_STALE_RATIO R(1.7)

/* and so much [lambda_noise]. larger: as above; smaller: noise is reported */
#define EITS_STALE_NOISE R(5.0)

/* ---- Chosen: by hand, between what loses touches (.1 and 10 times the reference's scale, with the
 * library's two_touch) and the scenes of the library: .87 to 1.19 times, and .74 with a loose
 * electrode. Check: scripts/test tests/python/oracle/test_faults.py -k scale */

/* all rows together have more than so many times the reference's size, or less than its inverse.
 * larger: touches are lost without a word; smaller: hands on small pads are reported */
#define EITS_STALE_SCALE R(2.0)

/* ---- Chosen: by hand: 16 frames of 8 and 16 electrodes with a touch in the reference leave at
 * least .3 on 16, ring7 on 8 electrodes leaves at most .005. Check: scripts/test
 * tests/python/acceptance/test_library_scenes.py */

/* touches that leave less explain a frame with their sign, and what goes against it are lobes of
 * few electrodes [of |y|^2]. larger: a reference with a touch in it goes unnoticed; smaller: as
 * STALE_RATIO */
#define EITS_STALE_EXPLAINED R(0.05)

/* ---- Chosen: by counting: a disc has a place and a strength. Check: scripts/test
 * tests/python/acceptance/test_library_scenes.py */

/* touches with more than this many numbers each than there are data cannot be separated. larger:
 * few electrodes report crowds that are right */
#define EITS_CROWD_NUMBERS 3

/* ---- Chosen: on a hydrogel skin taught by its first 100 presses, seven streams of 60 from press
 * 100 to 340: 1 false touch, 2 of 420 presses held back; .3 whatever max(S'y) is: false touches
 * stop the reference in five. Check: eitskin study teaching --data FOLDER */

/* touches that leave more, times 1 + max(S'y) over the detection threshold, are the skin's own
 * change, while the reference follows [of |y|^2]. larger: false touches stop the reference;
 * smaller: light touches are held back */
#define EITS_DRIFT_UNEXPLAINED R(0.06)

/* but what stands out by so much is a touch [of the detection threshold]. larger: a palm may be
 * held back; smaller: fast drift stops the reference */
#define EITS_DRIFT_CLEAR R(4.0)

/* ---- Chosen: with the rules above; the run that chose them was not kept. Three limits, as none
 * alone does (reference_outliers.c). Study constants: at half and at double each changes at most 10
 * of 80 references with readings that are off, and no exact frame; PAIRED_MIN and CHANGED_AS_MUCH
 * change nothing. Check: ctest --preset host -R reference */

/* reference frames: a row against its reciprocal [robust deviations]. larger: an outlier stays in
 * the reference; smaller: noise is averaged away */
#define EITS_PAIRED R(12.0)

/* and at least so much [of the greatest voltage]. larger: as above; smaller: quantised voltages,
 * whose median is 0, lose readings */
#define EITS_PAIRED_MIN R(0.001)

/* the same where rows have no reciprocals, or copies [robust deviations]. as PAIRED; also drift is
 * met */
#define EITS_UNPAIRED R(16.0)

/* and at least so much [of the greatest voltage]. as PAIRED_MIN */
#define EITS_UNPAIRED_MIN R(0.01)

/* and at least so much: noise may go with it [of the row's own voltage]. larger: outliers of large
 * rows stay; smaller: their noise is left out */
#define EITS_OWN_MIN R(0.05)

/* both rows of a fold go where each changed by so much [of the other row's change]. larger: the
 * wrong one may stay; smaller: the good one goes, too */
#define EITS_CHANGED_AS_MUCH R(0.5)

/* ---- Chosen: a logistic regression of whether a frame is exact, on mixed tuning scenes of 1 to 12
 * touches at 40, 60 and 80 dB (fit_rule of the study, whose tuning seed is 100001 by default; the
 * seed of this fit was not kept). CROWD_MIN: the lowest score above which 95 % are exact, from 60
 * dB on. Check: eitskin study multitouch */

/* of the score [log odds]. larger: fewer frames are crowded */
#define EITS_CROWD_OFFSET R(-0.3583)

/* by touch, over the number of electrodes; fitted on a skin of 16, other numbers were not measured
 * [log odds each]. nearer 0: many touches pass unreported */
#define EITS_CROWD_TOUCHES R(-3.8864)

/* by the least distance over the sum of the radii [log odds]. larger: overlapping touches count for
 * more */
#define EITS_CROWD_NEAREST R(3.645)

/* by the greatest radius over the seed's [log odds]. nearer 0: one wide touch that is two passes */
#define EITS_CROWD_WIDEST R(-4.607)

/* by the root of what is left of |y|^2 [log odds]. nearer 0: what no touch explains passes */
#define EITS_CROWD_LEFT R(-3.659)

/* by the weakest touch over noise [log odds]. larger: a weak touch makes a crowd */
#define EITS_CROWD_WEAKEST R(0.1329)

/* by the weakest touch over what is left [log odds]. larger: a touch near the residual makes a
 * crowd */
#define EITS_CROWD_CLEAREST R(0.7892)

/* below it the count is a guess [log odds]. larger: reports frames that are right; smaller: misses
 * wrong counts */
#define EITS_CROWD_MIN R(1.078)

/* ---- Chosen: limits of the score's features and of where it is asked. Study constants, wrong
 * diagnostics of 1459 frames more at half and at double: CROWD_FAR 276 and 27, CROWD_FAINT 27 and 3
 * fewer, CROWD_CLEAR 21 and 1, CROWD_STRONG 3 and 1. Check: eitskin study constants --data
 * FOLDER */

/* at most this [sums of radii]. larger: the far ones are separated */
#define EITS_CROWD_FAR R(2.0)

/* at most this [noise]. larger: strong touches are separated */
#define EITS_CROWD_STRONG R(10.0)

/* at most this. larger: clear touches are separated */
#define EITS_CROWD_CLEAR R(3.0)

/* max(S'y) below it may be noise, and no crowd [lambda_noise]. larger: crowds of faint touches
 * pass; smaller: noise is a crowd */
#define EITS_CROWD_FAINT R(3.0)

/* ---- Chosen: by hand: well above float32 rounding, which was not measured at high ranks. Check:
 * ctest --preset host -R uncertainty */

/* a matrix of section UNCE that is negative by less counts as a covariance [of a diagonal element].
 * larger: damaged models are used; smaller: rounding refuses good ones */
#define EITS_SECOND_MOMENT_ROUNDING R(0.0001)

/* ---- Chosen: mathematics: the deviation of a normal distribution over the median of its
 * magnitudes. Check: ctest --preset host -R outliers */

/* makes a median of magnitudes a deviation [deviations a median]. nothing; here since C and numpy
 * share it */
#define EITS_ROBUST R(1.4826)

/* clang-format on */

#endif

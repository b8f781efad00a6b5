/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_DIAGNOSTICS_CONSTANTS_H
#define EITSKIN_DIAGNOSTICS_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on 64 scenes of one to three touches, contacts +-20 %, 40, 60 and 80 dB, full and
 * half scans, seeds 77 and 177 (docs/reference/diagnostics.md); which number on which seed was not
 * kept. Check: eitskin bench diagnostics --seed 4001 */

/* least reference of a row that shows whether an electrode is connected [of the reference's rms].
 * larger: too few rows count; smaller: rows that are small by geometry look dead */
#define EITS_ROW_SIGNIFICANT R(0.3)

/* and at least this many times the noise limit of a dead row [of ROW_DEAD_NOISE's limit]. larger:
 * too few rows count on noisy boards; smaller: noise makes a row look dead */
#define EITS_ROW_SIGNIFICANT_NOISE R(10.0)

/* a row with less is dead [of the reference]. larger: a strong touch beside an electrode makes it
 * look open; smaller: leakage of an open electrode hides it */
#define EITS_ROW_DEAD_FRACTION R(0.02)

/* a row with less is dead [noise_v]. larger: too few rows count; smaller: noise of an open
 * electrode looks like a signal */
#define EITS_ROW_DEAD_NOISE R(5.0)

/* at least this many rows must agree on an electrode or a pair; this many rows with a changed sign
 * are a mismatch [rows]. larger: electrodes with few rows are never named; smaller: two chance
 * faults name one */
#define EITS_ROWS_TO_JUDGE 3

/* a row that is greater is an outlier [of the reference]. larger: broken amplifiers go unnoticed;
 * smaller: strong touches are left out */
#define EITS_ROW_GROWN R(8.0)

/* a smaller reference counts as this large [of the reference's rms]. larger: outliers of small rows
 * pass; smaller: rows near zero are left out */
#define EITS_ROW_SMALL R(0.05)

/* reciprocal rows may differ by this multiple of their noise [deviations]. larger: outliers stay in
 * the image; smaller: noise leaves good rows out */
#define EITS_OUTLIER_NOISE R(6.5)

/* the same without a learned noise: the deviation is that of all differences in the frame [robust
 * deviations]. as OUTLIER_NOISE */
#define EITS_OUTLIER_ROBUST R(16.0)

/* they may always differ by this much, because common-mode errors scale with the largest datum [of
 * the largest datum]. larger: outliers of small touches stay; smaller: common-mode errors mask
 * rows */
#define EITS_OUTLIER_LARGEST R(0.03)

/* and by this much, because the errors of unequal channel gains scale with the change [of the
 * larger side]. larger: outliers stay; smaller: unequal channels lose rows */
#define EITS_OUTLIER_FRACTION R(0.25)

/* one side stays if its distance from the prediction by the other folds is at most this fraction of
 * the other side's. larger: the wrong side may stay; smaller: both are left out, and a good row is
 * lost */
#define EITS_OUTLIER_NEARER R(0.5)

/* if more folds are flagged, they are not outliers [folds]. larger: the rows of a noisy electrode
 * are left out one by one; smaller: it is named too soon */
#define EITS_OUTLIER_MAX 8

/* a fold with less that is independent of the others is not predicted [of a fold]. larger: fewer
 * are predicted; smaller: predictions by rounding */
#define EITS_OUTLIER_PIVOT R(0.05)

/* ridge of the prediction [of the greatest s^2]. larger: predicts too little of strong touches;
 * smaller: predicts noise */
#define EITS_OUTLIER_RIDGE R(0.0001)

/* without reciprocals, a fold is flagged beyond this multiple of the prediction errors [robust
 * deviations]. larger: outliers of half scans stay; smaller: touches of odd shape lose rows */
#define EITS_OUTLIER_UNPAIRED R(16.0)

/* and if at least this is in that fold [of what is not predicted]. as OUTLIER_UNPAIRED */
#define EITS_OUTLIER_ENERGY R(0.5)

/* an electrode is noisy if at least this many flagged folds use it [of the flagged folds]. larger:
 * noisy electrodes become mismatches; smaller: an electrode is blamed for others */
#define EITS_NOISY_FRACTION R(0.9)

/* a greater part outside the model's range is a mismatch [of |d|]. larger: swapped wires go
 * unnoticed; smaller: unequal contacts are reported */
#define EITS_MISMATCH_FRACTION R(0.05)

/* if it also exceeds this multiple of the noise there [deviations]. larger: as above on noisy
 * boards; smaller: noise is reported */
#define EITS_MISMATCH_NOISE R(3.0)

/* the reference is stale if the change against the sign rule exceeds this [of lambda_max]. larger:
 * a reference with a touch in it goes unnoticed; smaller: ripple beside a touch is reported */
#define EITS_STALE_RATIO R(1.7)

/* and this [lambda_noise]. larger: as above; smaller: noise is reported */
#define EITS_STALE_NOISE R(5.0)

/* ---- Chosen: by hand, between what loses touches (.1 and 10 times the reference's scale, with the
 * library's two_touch) and the scenes of the library: .87 to 1.19 times, and .74 with a loose
 * electrode. Check: scripts/test tests/python/oracle/test_faults.py -k scale */

/* all rows together have more than this many times the reference's size, or less than the inverse.
 * larger: touches are lost without a report; smaller: hands on small pads are reported */
#define EITS_STALE_SCALE R(2.0)

/* ---- Chosen: by hand: 16 frames of 8 and 16 electrodes with a touch in the reference leave at
 * least .3 on 16, ring7 on 8 electrodes leaves at most .005. Check: scripts/test
 * tests/python/acceptance/test_library_scenes.py */

/* touches that leave less explain the frame; the change against the sign rule is then a side lobe,
 * as few electrodes give [of |y|^2]. larger: a reference with a touch in it goes unnoticed;
 * smaller: as STALE_RATIO */
#define EITS_STALE_EXPLAINED R(0.05)

/* ---- Chosen: by counting: a disc has a place and a strength. Check: scripts/test
 * tests/python/acceptance/test_library_scenes.py */

/* touches cannot be separated if the number of touches times this exceeds the number of data.
 * larger: few electrodes report crowds that are right */
#define EITS_CROWD_NUMBERS 3

/* ---- Chosen: on a hydrogel skin taught by its first 100 presses, seven streams of 60 from press
 * 100 to 340: 1 false touch, 2 of 420 presses held back; .3 whatever max(S'y) is: false touches
 * stop the reference in five. Check: eitskin study teaching --data FOLDER */

/* while reference tracking is on, touches that leave more, times 1 + max(S'y) over the detection
 * threshold, are changes of the skin itself [of |y|^2]. larger: false touches stop the reference;
 * smaller: light touches are held back */
#define EITS_DRIFT_UNEXPLAINED R(0.06)

/* but a change that stands out by this is a touch [of the detection threshold]. larger: a palm may
 * be held back; smaller: fast drift stops the reference */
#define EITS_DRIFT_CLEAR R(4.0)

/* ---- Chosen: with the rules above; the run that chose them was not kept. Three limits, as none
 * alone does (reference_outliers.c). Study constants: at half and at double each changes at most 10
 * of 80 references with readings that are off, and no exact frame; PAIRED_MIN and CHANGED_AS_MUCH
 * change nothing. Check: ctest --preset host -R reference */

/* a reading of a reference frame is left out if its row differs from the reciprocal row by more
 * [robust deviations]. larger: an outlier stays in the reference; smaller: noise is averaged
 * away */
#define EITS_PAIRED R(12.0)

/* and at least so much [of the greatest voltage]. larger: as above; smaller: quantised voltages,
 * whose median is 0, lose readings */
#define EITS_PAIRED_MIN R(0.001)

/* the same for rows without measured reciprocals [robust deviations]. as PAIRED; drift counts here,
 * too */
#define EITS_UNPAIRED R(16.0)

/* and at least so much [of the greatest voltage]. as PAIRED_MIN */
#define EITS_UNPAIRED_MIN R(0.01)

/* and at least so much, because noise may be proportional to the voltage [of the row's own
 * voltage]. larger: outliers of large rows stay; smaller: their noise is left out */
#define EITS_OWN_MIN R(0.05)

/* both rows of a fold are left out if the smaller change is at least this [of the other row's
 * change]. larger: the wrong one may stay; smaller: the good one is left out, too */
#define EITS_CHANGED_AS_MUCH R(0.5)

/* ---- Chosen: a logistic regression of whether a frame is exact, on mixed tuning scenes of 1 to 12
 * touches at 40, 60 and 80 dB (fit_rule of the study, whose tuning seed is 100001 by default; the
 * seed of this fit was not kept). CROWD_MIN: the lowest score above which 95 % are exact, from 60
 * dB on. Check: eitskin study multitouch */

/* constant of the score [log odds]. larger: fewer frames are crowded */
#define EITS_CROWD_OFFSET R(-0.3583)

/* coefficient of the number of touches over the number of electrodes; it was fitted on a skin with
 * 16, and not measured with others [log odds each]. nearer 0: many touches pass unreported */
#define EITS_CROWD_TOUCHES R(-3.8864)

/* coefficient of the least distance over the sum of the radii [log odds]. larger: overlapping
 * touches count for more */
#define EITS_CROWD_NEAREST R(3.645)

/* coefficient of the greatest radius over the seed's [log odds]. nearer 0: one wide touch that is
 * really two goes unreported */
#define EITS_CROWD_WIDEST R(-4.607)

/* coefficient of the root of the unexplained fraction of |y|^2 [log odds]. nearer 0: changes that
 * no touch explains go unreported */
#define EITS_CROWD_LEFT R(-3.659)

/* coefficient of the weakest touch over noise [log odds]. larger: a weak touch makes a crowd */
#define EITS_CROWD_WEAKEST R(0.1329)

/* coefficient of the weakest touch over the residual [log odds]. larger: a touch near the residual
 * makes a crowd */
#define EITS_CROWD_CLEAREST R(0.7892)

/* with a lower score the count is a guess [log odds]. larger: reports frames that are right;
 * smaller: misses wrong counts */
#define EITS_CROWD_MIN R(1.078)

/* ---- Chosen: limits of the score's features and of where it is asked. Study constants, wrong
 * diagnostics of 1459 frames more at half and at double: CROWD_FAR 276 and 27, CROWD_FAINT 27 and 3
 * fewer, CROWD_CLEAR 21 and 1, CROWD_STRONG 3 and 1. Check: eitskin study constants --data
 * FOLDER */

/* upper limit of the least distance in the score [sums of radii]. larger: the far ones are
 * separated */
#define EITS_CROWD_FAR R(2.0)

/* upper limit of the weakest touch over noise in the score [noise]. larger: strong touches are
 * separated */
#define EITS_CROWD_STRONG R(10.0)

/* upper limit of the weakest touch over the residual in the score. larger: clear touches are
 * separated */
#define EITS_CROWD_CLEAR R(3.0)

/* a frame with a lower max(S'y) may be noise, and is not examined [lambda_noise]. larger: crowds of
 * faint touches pass; smaller: noise is a crowd */
#define EITS_CROWD_FAINT R(3.0)

/* ---- Chosen: by hand: well above float32 rounding, which was not measured at high ranks. Check:
 * ctest --preset host -R uncertainty */

/* a matrix of section UNCE that is negative by less counts as a covariance [of a diagonal element].
 * larger: damaged models are used; smaller: rounding refuses good ones */
#define EITS_SECOND_MOMENT_ROUNDING R(0.0001)

/* ---- Chosen: mathematics: the deviation of a normal distribution over the median of its
 * magnitudes. Check: ctest --preset host -R outliers */

/* makes a median of magnitudes a deviation [deviations a median]. nothing; it is in this table
 * because C and numpy share it */
#define EITS_ROBUST R(1.4826)

/* clang-format on */

#endif

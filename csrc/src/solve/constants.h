/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_SOLVE_CONSTANTS_H
#define EITSKIN_SOLVE_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: from rounding. Study constants: at half and at double EPSILON, INDEPENDENT and
 * TOLERANCE_EPSILONS change 3 of 74 scenes at most, MAX_STEP_HALVINGS 4 of models with a wrong
 * Lipschitz constant, MAX_STALLS and MAX_RISE none; no exact frame is lost. Check: ctest --preset
 * host -R exact_optimum */

/* the rounding of one operation. larger: optima are declared early; smaller: rounding is chased */
#define EITS_EPSILON R(sizeof(eits_real) == 4 ? 1.2e-07 : 2.3e-16)

/* what must be left of a column beside the active ones; a difference of squares, known to rank
 * times epsilon [of its square]. larger: good columns make others leave; smaller: the factor breaks
 * down */
#define EITS_INDEPENDENT R(sizeof(eits_real) == 4 ? 1e-05 : 1e-10)

/* a correlation beyond lambda by less is rounding [EPSILON |s_j| |y|]. larger: ends before the
 * optimum; smaller: looks for what rounding made */
#define EITS_TOLERANCE_EPSILONS 2

/* without a lower objective end the active set [rounds]. larger: rounds for nothing; smaller:
 * several columns at once may undo each other, and no round with one alone is tried */
#define EITS_MAX_STALLS 2

/* a rise by less is rounding, by more a step too long; so is a gap of an image of zeros, of |y|^2 /
 * 2 [of the objective]. larger: divergence is found late; smaller: rounding halves the step */
#define EITS_MAX_RISE R(0.001)

/* data with less are zero: 2^24 (2^53) times the smallest normal number, so that its rounding is
 * normal [of |y|^2]. larger: tiny data have no image; smaller: their gap is rounding */
#define EITS_MIN_SQUARE R(sizeof(eits_real) == 4 ? 0x1p-102 : 0x1p-969)

/* a Lipschitz constant wrong by more than 256 is no rounding. larger: useless models cost more;
 * smaller: models that round coarsely fail */
#define EITS_MAX_STEP_HALVINGS 8

/* ---- Chosen: PRUNE_EVERY with the kernels for the Cortex-M7 (commit 73fe7cf7), LOOK_GROWTH to
 * bring the default frame within 2.5 million instructions there (6d3042fb). Study constants,
 * multiply-accumulates at half and at double: PRUNE_EVERY -0.9 and +1.7 %, LOOK_GROWTH +2.8 and 0
 * %; one exact frame of 1459 is lost with PRUNE_EVERY 2. Check: eitskin bench board */

/* the working set leaves out columns at rest; repacking costs about an iteration [iterations].
 * larger: products over columns at rest; smaller: repacks for nothing */
#define EITS_PRUNE_EVERY 5

/* each look at every column comes so many times as late as the one before. larger: columns join
 * late, and the image differs from FISTA's; smaller: more looks */
#define EITS_LOOK_GROWTH 6

/* ---- Chosen: by hand: they change the time only. Study constants: no exact frame and no
 * diagnostic changes at half and at double, the multiply-accumulates by less than 0.02 %;
 * SIEVE_BLOCK changes no bit. Check: eitskin bench solve */

/* what a look nearby must have won to be followed by another [of the objective]. larger: more looks
 * at every column; smaller: looks nearby for nothing */
#define EITS_WORTHWHILE R(1e-06)

/* at most so many after one at every column: a bound [looks]. larger: longer rounds; smaller: more
 * looks at every column */
#define EITS_LOOKS_NEARBY 20

/* tested at a time for exceeding lambda [columns]. larger: blocks are seldom empty; smaller: more
 * turns */
#define EITS_SIEVE_BLOCK 32

/* clang-format on */

#endif

/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_MULTIPOLE_CONSTANTS_H
#define EITSKIN_MULTIPOLE_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on exact frames (boundary integrals) of discs and ellipses, seed 3: degree 5 within
 * 2.6 pixels has the least error of the answers at discs of radius 6 to 12 mm. Check: scripts/test
 * tests/python/acceptance/test_joint_fit.py */

/* the polynomial of the fields about a place is fitted to the pixels within this distance [pixels].
 * larger: more terms are needed than there are; smaller: noise of the stored fields */
#define EITS_POLE_REACH R(2.6)

/* the polynomial is kept as long as the middle is nearer than this to the home pixel's middle,
 * along either axis [pixels]. larger: answers are wrong; smaller: more work */
#define EITS_POLE_STAYS R(1.0)

/* monomials are of z over this, so that none is far greater than 1 [pixels]. anything else loses
 * digits in float32 */
#define EITS_POLE_UNIT R(2.0)

/* a monomial of which no more than this is left is a sum of those before it; this happens at the
 * rim, where few pixels are kept [relative]. larger: drops terms that carry information; smaller:
 * keeps rounding */
#define EITS_POLE_DEPENDENT R(1e-05)

/* a mirror is that of a round skin if the middle of its circle, times |b|, is this near the origin
 * [pixels]. larger: other outlines get the circle of a round skin; smaller: the rounding of the
 * stored b of a large grid exceeds it */
#define EITS_POLE_CENTRED R(0.05)

/* at places nearer to the rim, the rim counts as straight [pixels]. larger: the rim's curvature is
 * lost; smaller: it is rounding of the stored mirror */
#define EITS_POLE_DEPTH R(0.05)

/* touches further apart act on each other as dipoles [sums of radii]. larger: more work; smaller:
 * answers of near touches are wrong by more than .3 % */
#define EITS_POLE_FAR R(2.5)

/* greatest eta of an ellipse: axes of 7 to 1. larger: the Taylor series has to reach further than
 * it holds */
#define EITS_POLE_MAX_ETA R(0.75)

/* step of the finite differences for the slopes by an ellipse's parameters. larger: errors by
 * curvature; smaller: by rounding in float32 */
#define EITS_POLE_STEP R(0.01)

/* clang-format on */

#endif

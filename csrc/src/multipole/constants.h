/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_MULTIPOLE_CONSTANTS_H
#define EITSKIN_MULTIPOLE_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: on exact frames (boundary integrals) of discs and ellipses, seed 3: degree 5 within
 * 2.6 pixels has the least error of the answers at discs of radius 6 to 12 mm. Check: scripts/test
 * tests/python/acceptance/test_joint_fit.py */

/* pixels within it give the polynomial of the fields about a place [pixels]. larger: more terms are
 * wanted than there are; smaller: noise of the stored fields */
#define EITS_POLE_REACH R(2.6)

/* the polynomial is kept while the middle is nearer to the home pixel's along either axis [pixels].
 * larger: answers err; smaller: costs */
#define EITS_POLE_STAYS R(1.0)

/* monomials are of z over this, so that none is far greater than 1 [pixels]. anything else loses
 * digits in float32 */
#define EITS_POLE_UNIT R(2.0)

/* a monomial of which no more is left is a sum of those before it: at the rim, where few pixels are
 * kept [relative]. larger: drops terms that tell something; smaller: keeps rounding */
#define EITS_POLE_DEPENDENT R(1e-05)

/* a mirror whose circle has its middle this near the origin, times |b|, is that of a round skin
 * [pixels]. larger: other outlines get the circle of a round skin; smaller: rounding of the stored
 * b of a large grid passes it */
#define EITS_POLE_CENTRED R(0.05)

/* nearer to the rim, it counts as straight [pixels]. larger: the rim's curvature is lost; smaller:
 * it is rounding of the stored mirror */
#define EITS_POLE_DEPTH R(0.05)

/* touches further apart meet as dipoles [sums of radii]. larger: costs; smaller: answers of near
 * touches err by more than .3 % */
#define EITS_POLE_FAR R(2.5)

/* greatest eta of an ellipse, axes of 1 to 7. larger: the Taylor series has to reach further than
 * it holds */
#define EITS_POLE_MAX_ETA R(0.75)

/* difference by which slopes by the parameters of an ellipse are taken. larger: curvature; smaller:
 * rounding in float32 */
#define EITS_POLE_STEP R(0.01)

/* clang-format on */

#endif

/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_API_CONSTANTS_H
#define EITSKIN_API_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: by hand: two frames for a first mean, two to compare with it; not measured. Check:
 * ctest --preset host -R reference */

/* least that noise is learned from [frames]. larger: short tares fail; smaller: noise of one
 * difference */
#define EITS_MIN_REFERENCE_FRAMES 4

/* clang-format on */

#endif

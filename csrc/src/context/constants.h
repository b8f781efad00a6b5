/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_CONTEXT_CONSTANTS_H
#define EITSKIN_CONTEXT_CONSTANTS_H

#include "base/vec.h"

/* clang-format off */

/* ---- Chosen: study constants: half changes 2 of 371 scenes and no exact frame, double none.
 * Check: ctest --preset host -R places */

/* a place is corrected by at most this along x and y [pixels]. larger: an instrument that differs
 * moves touches; smaller: misplaced electrodes do */
#define EITS_MAX_SHIFT R(1.0)

/* places are corrected for a fit that weighs the model's errors where the reference is further from
 * the model [row_errors.distance]. larger: uneven skins are fitted as if they were the model;
 * smaller: good skins lose data */
#define EITS_ERRORS_FROM R(0.15)

/* clang-format on */

#endif

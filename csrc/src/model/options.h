/* Whether options are in range: asked for a model's own when it is opened, and for a caller's. */
#ifndef EITS_OPTIONS_IN_RANGE_H
#define EITS_OPTIONS_IN_RANGE_H

#include "eitskin/options.h"

/* 1 where every option lies in its range (eits_option_table) and the radii ascend, least, seed,
 * greatest. */
int eits_options_in_range(const eits_options *options);

#endif

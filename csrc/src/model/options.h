/* Check whether options are in range: a model's own when it is opened, and a caller's. */
#ifndef EITS_OPTIONS_IN_RANGE_H
#define EITS_OPTIONS_IN_RANGE_H

#include "eitskin/options.h"

/* Returns 1 if every option is in its range (eits_option_table) and the radii ascend: minimum,
 * seed, maximum. */
int eits_options_in_range(const eits_options *options);

#endif

#ifndef EITSKIN_OPTIONS_H
#define EITSKIN_OPTIONS_H

#include "eitskin/context.h"

/* 1 where each option is within its documented range, and finite. */
int eits_options_valid(const eits_options *o);

#endif

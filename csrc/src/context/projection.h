#ifndef EITSKIN_PROJECTION_H
#define EITSKIN_PROJECTION_H

#include "context/context.h"

/* Take the basis' directions out of v (stride numbers); returns the multiply-accumulates. */
uint64_t eits_project(const eits_context *ctx, eits_real *v);

#endif

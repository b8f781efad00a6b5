/* eitskin: everything, in the order of the data's way. */
#ifndef EITSKIN_H
#define EITSKIN_H

#include "eitskin/batch.h"
#include "eitskin/context.h"
#include "eitskin/diagnostics.h"
#include "eitskin/force.h"
#include "eitskin/frame.h"
#include "eitskin/link.h"
#include "eitskin/model.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"
#include "eitskin/types.h"

#endif

/* eitskin: touches of a skin from voltages at its rim. This header includes all others.
 *
 * A skin is a conductive sheet with electrodes at its rim. A frame is the list of boundary voltages
 * that the model's protocol names, in volts and in its order. The core takes the change of a frame
 * against the reference frame, finds the sparsest change of conductivity that explains it, and fits
 * touches to that.
 *
 *     model.h        a stored model, read in place, from flash or from memory
 *     context.h      options, results, and the workspace of one reconstruction
 *     sizes.h        how large a workspace is, and which arrays are in it
 *     frame.h        the reference, and from a frame to the solver's data
 *     diagnostics.h  what is wrong with a frame, by name
 *     solve.h        from the data to an image
 *     touch.h        from the image to touches; force.h: how hard they press
 *     fast.h         touches after each drive, before the frame is whole
 *     gesture.h      from touches in time to taps, swipes, pinches; zone.h: named zones pressed
 *     batch.h        many frames at once, on a host
 *     link.h         the packets between a board and a host
 *     types.h        scalar, status, version
 *
 * Rules for all functions: the caller owns all memory; nothing is allocated, printed or kept in a
 * global. Lengths are in mm, voltages in V, conductivity in S/m; names carry the unit. Sums have
 * one order, so that every build gives the same bits, as long as it is compiled without contraction
 * (-ffp-contract=off) and without -ffast-math. A function that fails returns an eits_status below 0
 * and leaves its outputs as they were, or clears them if its comment says so. It never writes NaN.
 *
 * From a frame to touches, without the checks for errors (examples/c/minimal.c has them):
 *
 *     eits_model model;
 *     eits_model_open(&model, blob, blob_size);
 *     eits_context *skin;
 *     eits_init(workspace, workspace_size, &model, &skin);
 *     eits_reference_set(skin, untouched_frame, model.n_rows);
 *     eits_touch touch[EITS_MAX_TOUCHES];
 *     uint32_t count;
 *     eits_reconstruct(skin, frame, model.n_rows, NULL, NULL);
 *     eits_find_touches(skin, touch, EITS_MAX_TOUCHES, &count);
 */
#ifndef EITSKIN_H
#define EITSKIN_H

#include "eitskin/batch.h"
#include "eitskin/context.h"
#include "eitskin/diagnostics.h"
#include "eitskin/fast.h"
#include "eitskin/force.h"
#include "eitskin/frame.h"
#include "eitskin/gesture.h"
#include "eitskin/link.h"
#include "eitskin/model.h"
#include "eitskin/options.h"
#include "eitskin/packets.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"
#include "eitskin/types.h"
#include "eitskin/zone.h"

#endif

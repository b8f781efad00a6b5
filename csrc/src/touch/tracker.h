/* Touches followed from frame to frame: when tracks start and end, ids, places smoothed in time.
 * docs/guide/tracking.md says what each is worth. */
#ifndef EITSKIN_TRACK_H
#define EITSKIN_TRACK_H

#include "context/context.h"

/* From the `count` touches that were found in a frame (room for EITS_MAX_TOUCHES) to those that are
 * reported, in their place, strongest first; returns how many. info says how clear the frame
 * is.
 *
 * Nearest pairs of a touch that is followed and one that is found, within follow_mm, belong
 * together; those that were reported choose first. Ids count up from 1 and are given when a touch
 * is first reported. */
uint32_t eits_track(eits_context *ctx, eits_touch *touches, uint32_t count);

#endif

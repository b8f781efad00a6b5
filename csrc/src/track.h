/* Ids that follow touches from frame to frame. */
#ifndef EITSKIN_TRACK_H
#define EITSKIN_TRACK_H

#include "eitskin/context.h"

/* Give each of `count` touches the id of the nearest touch of the last frame within follow_mm, nearest pairs first, or a
 * new one; keep them as the last frame's. */
void eits_track(eits_context *ctx, eits_touch *touches, uint32_t count);

#endif

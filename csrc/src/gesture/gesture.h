/* What the parts of this room share. */
#ifndef EITSKIN_GESTURE_ROOM_H
#define EITSKIN_GESTURE_ROOM_H

#include "base/vec.h"
#include "eitskin/gesture.h"
#include "gesture/constants.h"

enum { CONTACT_NONE = 0, CONTACT_NEW = 1, CONTACT_DOWN = 2, CONTACT_LIFTED = 3 };

/* Bits of a contact's flags. */
enum {
    CONTACT_SEEN = 1,     /* in this frame */
    CONTACT_WITH = 2,     /* another finger was down beside it: no gesture of one finger */
    CONTACT_DONE = 4,     /* its hold or swipe was told */
    CONTACT_TAPPED = 8,   /* its tap was told, before it was found again */
    CONTACT_DUBIOUS = 16, /* it must last doubt_us to be told */
    CONTACT_GOING = 32,   /* it was letting go when it was last found */
    CONTACT_RENAMED = 64  /* in this frame it took another touch's place */
};

/* Where a frame's events go. */
typedef struct event_list {
    eits_event *events;
    uint32_t room, count, *dropped;
} event_list;

static inline void eits_tell(event_list *out, eits_event event)
{
    if (out->count < out->room)
        out->events[out->count++] = event;
    else
        ++*out->dropped;
}

static inline eits_real eits_apart(eits_real dx_mm, eits_real dy_mm)
{
    return eits_sqrt(dx_mm * dx_mm + dy_mm * dy_mm);
}

/* No number is none, nor is one whose square would overflow. */
static inline int eits_is_place(eits_real x_mm, eits_real y_mm)
{
    return eits_fabs(x_mm) <= EITS_MAX_PLACE_MM && eits_fabs(y_mm) <= EITS_MAX_PLACE_MM;
}

/* The angle of (x, y) from the first axis, -180 to 180 degrees; of (0, 0) it is 0. */
eits_real eits_angle_deg(eits_real y, eits_real x);

/* One finger: what its lifting was, and whether it holds. */
void eits_lifted(eits_gestures *g, eits_contact *c, event_list *out);
void eits_hold(eits_gestures *g, event_list *out);

/* Two fingers: after all contacts of a frame are known. */
void eits_pair_step(eits_gestures *g, event_list *out);
/* Before the contact at this place lifts. */
void eits_pair_lift(eits_gestures *g, uint32_t place, event_list *out);

#endif

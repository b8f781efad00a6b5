/* The files of this module share a finger's contact with the skin and the list that takes the
 * events of a frame. */
#ifndef EITSKIN_CONTACTS_H
#define EITSKIN_CONTACTS_H

#include "base/vec.h"
#include "eitskin/gesture.h"
#include "gesture/constants.h"

enum { CONTACT_NONE = 0, CONTACT_NEW = 1, CONTACT_DOWN = 2, CONTACT_LIFTED = 3 };

/* Bits of a contact's flags. */
enum {
    CONTACT_SEEN = 1, /* in this frame */
    CONTACT_WITH = 2, /* another finger was down beside it, so it makes no gesture of one finger */
    CONTACT_DONE = 4, /* its hold or swipe was reported */
    CONTACT_TAPPED = 8,   /* its tap was reported, before it was found again */
    CONTACT_DUBIOUS = 16, /* it must last doubt_us to be reported */
    CONTACT_GOING = 32,   /* it was lifting when it was last found */
    CONTACT_RENAMED = 64  /* in this frame it took another touch's place */
};

/* The list that takes the events of a frame. */
typedef struct event_list {
    eits_event *events;
    uint32_t room, count, *dropped;
} event_list;

static inline void eits_report(event_list *out, eits_event event)
{
    if (out->count < out->room)
        out->events[out->count++] = event;
    else
        ++*out->dropped;
}

#endif

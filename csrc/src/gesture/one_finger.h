/* Tap, double tap, hold and swipe. */
#ifndef EITSKIN_ONE_FINGER_H
#define EITSKIN_ONE_FINGER_H

#include "gesture/contacts.h"

/* The contact `c` has lifted: report the tap or the swipe that it was, if it was one. */
void eits_lifted(eits_gestures *g, eits_contact *c, event_list *out);

/* Report the contacts that hold. */
void eits_hold(eits_gestures *g, event_list *out);

#endif

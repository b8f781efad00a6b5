/* Pinch, spread and rotate. */
#ifndef EITSKIN_TWO_FINGERS_H
#define EITSKIN_TWO_FINGERS_H

#include "gesture/contacts.h"

/* Follow the pair of fingers. Call it when all contacts of a frame are known. */
void eits_pair_step(eits_gestures *g, event_list *out);

/* End the pair's gesture if the contact at this place is one of the two. Call it before that
 * contact lifts. */
void eits_pair_lift(eits_gestures *g, uint32_t place, event_list *out);

#endif

/* Turn tracked touches into fingers: which touch belongs to which finger, and when a finger lands,
 * moves and lifts.
 *
 * The tracker's ids are right nearly always. This file corrects the other cases: a touch that is
 * missed in a frame or comes back under another id is the same finger; a touch that appears beside
 * another, or is much fainter, is doubtful until it has lasted a while. */
#include "gesture/one_finger.h"
#include "gesture/plane.h"
#include "gesture/two_fingers.h"

enum { NO_CONTACT = EITS_MAX_CONTACTS };

eits_status eits_gestures_default(eits_gesture_options *options)
{
    if (options == NULL)
        return EITS_E_ARGUMENT;
    *options = (eits_gesture_options){.lost_us = EITS_LOST_US,
                                      .rejoin_us = EITS_REJOIN_US,
                                      .settle_us = EITS_SETTLE_US,
                                      .doubt_us = EITS_DOUBT_US,
                                      .short_us = EITS_SHORT_US,
                                      .tap_us = EITS_TAP_US,
                                      .double_us = EITS_DOUBLE_US,
                                      .hold_us = EITS_HOLD_US,
                                      .swipe_us = EITS_SWIPE_US,
                                      .speed_us = EITS_SPEED_US,
                                      .rejoin_mm = EITS_REJOIN_MM,
                                      .move_mm = EITS_MOVE_MM,
                                      .still_mm = EITS_STILL_MM,
                                      .double_mm = EITS_DOUBLE_MM,
                                      .swipe_mm = EITS_SWIPE_MM,
                                      .swipe_mm_per_s = EITS_SWIPE_MM_PER_S,
                                      .pair_mm = EITS_PAIR_MM,
                                      .split_mm = EITS_SPLIT_MM,
                                      .faint = EITS_FAINT,
                                      .firm = EITS_FIRM,
                                      .clear = EITS_TAP_CLEAR};
    return EITS_OK;
}

eits_status eits_gestures_init(eits_gestures *gestures, const eits_gesture_options *options)
{
    eits_gesture_options chosen;
    if (gestures == NULL)
        return EITS_E_ARGUMENT;
    (void)eits_gestures_default(&chosen);
    if (options != NULL)
        chosen = *options;
    const eits_real reals[] = {chosen.rejoin_mm, chosen.move_mm,  chosen.still_mm,
                               chosen.double_mm, chosen.swipe_mm, chosen.swipe_mm_per_s,
                               chosen.pair_mm,   chosen.split_mm, chosen.faint,
                               chosen.firm,      chosen.clear};
    for (size_t k = 0; k < sizeof reals / sizeof reals[0]; ++k) {
        if (!eits_is_finite(reals[k]) || reals[k] < 0)
            return EITS_E_ARGUMENT;
    }
    /* The options are checked first: with a NaN limit every comparison is false, and nothing would
     * move or rejoin. */
    memset(gestures, 0, sizeof *gestures);
    gestures->options = chosen;
    return EITS_OK;
}

/* ---- which is which ---- */

/* Returns 1 if the tracker repeats the touch as the contact last had it, because no frame and no
 * drive has shown it since. A touch that the frame lacks and drives follow is not held: its place
 * changes with every drive. */
static int is_held(const eits_contact *c, const eits_touch *touch)
{
    return !(touch->explained > 0) && touch->x_mm == c->seen_x_mm && touch->y_mm == c->seen_y_mm;
}

/* Returns 1 if a touch may still belong to this contact.
 *
 * A contact that lifted may come back within rejoin_us, but only by a touch that was found in the
 * frame: a touch that the tracker merely holds is no evidence of a finger. */
static int can_match(const eits_gestures *g, const eits_contact *c, const eits_touch *touch)
{
    if ((c->flags & CONTACT_SEEN) != 0 || c->state == CONTACT_NONE)
        return 0;
    return c->state != CONTACT_LIFTED ||
           (touch->explained > 0 && g->time_us - c->seen_us <= g->options.rejoin_us);
}

/* The tracker's id has priority: returns the contact that had this id, or NO_CONTACT. */
static uint32_t of_same_id(const eits_gestures *g, const eits_touch *touch)
{
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        if (g->contact[k].touch_id == touch->id && can_match(g, &g->contact[k], touch))
            return k;
    }
    return NO_CONTACT;
}

/* Returns the nearest contact that the touch may belong to, if the tracker has given the touch a
 * new id. */
static uint32_t of_same_place(const eits_gestures *g, const eits_touch *touch)
{
    eits_real nearest = g->options.rejoin_mm;
    uint32_t found = NO_CONTACT;
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        const eits_contact *c = &g->contact[k];
        const eits_real apart = eits_distance(touch->x_mm - c->x_mm, touch->y_mm - c->y_mm);
        /* a contact that was lifting has lifted; only the tracker's id may overrule this */
        const int lifted = c->state == CONTACT_LIFTED && (c->flags & CONTACT_GOING) != 0;
        if (!lifted && can_match(g, c, touch) && apart <= nearest) {
            nearest = apart;
            found = k;
        }
    }
    return found;
}

/* Returns a place for a new contact: an empty one, else the place of the contact that lifted first.
 *
 * Lifted contacts keep their place as long as it is not needed: they may come back. */
static uint32_t free_place(const eits_gestures *g)
{
    uint32_t found = NO_CONTACT, longest_us = 0;
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        const eits_contact *c = &g->contact[k];
        if (c->state == CONTACT_NONE)
            return k;
        const uint32_t since_us = g->time_us - c->seen_us;
        if (c->state == CONTACT_LIFTED && (c->flags & CONTACT_SEEN) == 0 &&
            since_us >= longest_us) {
            longest_us = since_us;
            found = k;
        }
    }
    return found;
}

/* ---- a finger's life ---- */

/* Note a contact's place, but not in a frame in which the finger lifts: such a scan shows the
 * finger beside its true place. */
static void note_place(const eits_gestures *g, eits_contact *c, const eits_touch *touch)
{
    const eits_real strength = eits_fabs(touch->strength_s_per_m_mm2);
    /* A scan in which a finger lifts has some rows with it and some without. Its strength falls,
     * and its place moves aside: such a frame shows that the finger is there, but not its place. */
    const int firm = strength >= g->options.firm * c->strength;
    if (touch->explained > 0) {
        const int going = !firm || touch->explained < EITS_GOING * c->explained;
        c->flags = going ? c->flags | CONTACT_GOING : c->flags & ~(uint32_t)CONTACT_GOING;
        c->explained = touch->explained;
        c->variance_mm2 = touch->x_variance_mm2 + touch->y_variance_mm2;
    } else if (!firm || ((c->flags & CONTACT_GOING) != 0 && is_held(c, touch))) {
        return; /* it was lifting, and no frame shows it any more: it has lifted */
    }
    c->touch_id = touch->id;
    c->seen_us = g->time_us;
    c->seen_x_mm = touch->x_mm;
    c->seen_y_mm = touch->y_mm;
    c->flags |= CONTACT_SEEN;
    /* a faint touch lowers the noted strength slowly, so that a finger that presses less for long
     * counts as firm again */
    c->strength = firm ? strength : c->strength + (strength - c->strength) * R(0.25);
    if (!firm || !(touch->explained > 0))
        return;
    const uint32_t at = c->trail_count++ % EITS_TRAIL;
    c->x_mm = c->trail_x_mm[at] = touch->x_mm;
    c->y_mm = c->trail_y_mm[at] = touch->y_mm;
    c->trail_us[at] = g->time_us;
    if (c->state != CONTACT_DOWN && c->state != CONTACT_LIFTED) {
        c->start_x_mm = c->x_mm;
        c->start_y_mm = c->y_mm;
        return;
    }
    const eits_real far = eits_distance(c->x_mm - c->start_x_mm, c->y_mm - c->start_y_mm);
    c->farthest_mm = eits_larger(far, c->farthest_mm);
}

/* Report an event at the contact's place; later movement is measured from here.
 *
 * Movement adds up from the place reported last, so that a slow finger is reported, too. */
static void report_place(const eits_gestures *g, eits_contact *c, uint32_t kind, event_list *out)
{
    c->reported_x_mm = c->x_mm;
    c->reported_y_mm = c->y_mm;
    eits_report(out, (eits_event){.kind = kind,
                                  .first_id = c->id,
                                  .time_us = g->time_us,
                                  .x_mm = c->x_mm,
                                  .y_mm = c->y_mm});
}

/* Report that the contact is down.
 *
 * Until now it might have been noise, which would have lifted again at once. */
static void land(const eits_gestures *g, eits_contact *c, event_list *out)
{
    c->state = CONTACT_DOWN;
    report_place(g, c, EITS_EVENT_DOWN, out);
}

/* Update a finger that this frame shows: it stays down, or it is found again after it seemed to
 * have lifted. */
static void go_on(eits_gestures *g, eits_contact *c, const eits_touch *touch, event_list *out)
{
    note_place(g, c, touch);
    const uint32_t wait_us =
        (c->flags & CONTACT_DUBIOUS) != 0 ? g->options.doubt_us : g->options.settle_us;
    if (c->state == CONTACT_LIFTED ||
        (c->state == CONTACT_NEW && g->time_us - c->born_us >= wait_us))
        land(g, c, out);
    else if (c->state == CONTACT_DOWN &&
             eits_distance(c->x_mm - c->reported_x_mm, c->y_mm - c->reported_y_mm) >=
                 g->options.move_mm)
        report_place(g, c, EITS_EVENT_MOVE, out);
}

/* Returns 1 for a touch beside a contact that is down, or much fainter than one that is down.
 *
 * A solver makes both of one clear touch: the touch splits, or it leaves a ghost elsewhere. */
static int is_doubtful(const eits_gestures *g, const eits_touch *touch)
{
    const eits_real strength = eits_fabs(touch->strength_s_per_m_mm2);
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        const eits_contact *c = &g->contact[k];
        if (c->state == CONTACT_DOWN &&
            (eits_distance(touch->x_mm - c->x_mm, touch->y_mm - c->y_mm) < g->options.split_mm ||
             strength < g->options.faint * c->strength))
            return 1;
    }
    return 0;
}

/* Begin a contact for a touch that belongs to no known finger. It is not reported before it has
 * lasted. */
static void begin_contact(eits_gestures *g, const eits_touch *touch)
{
    const uint32_t place = free_place(g);
    if (place == NO_CONTACT) {
        /* counted, not replaced: to drop a finger that is down would report a lift that was none */
        ++g->dropped;
        return;
    }
    const uint32_t flags = is_doubtful(g, touch) ? CONTACT_DUBIOUS : 0;
    eits_contact *c = &g->contact[place];
    *c = (eits_contact){
        .state = CONTACT_NEW, .id = touch->id, .flags = flags, .born_us = g->time_us};
    note_place(g, c, touch);
}

/* ---- a frame ---- */

/* Check a touch: it may come over a link, where the bits of a number may be anything. */
static int is_touch(const eits_touch *touch)
{
    return eits_is_place(touch->x_mm, touch->y_mm) && eits_is_finite(touch->strength_s_per_m_mm2);
}

/* Match touches and contacts in three rounds over all touches: first by id, then by place; the rest
 * is new. The rounds make sure that a contact whose touch keeps its id is never taken by another
 * touch that came near. */
static void match(eits_gestures *g, const eits_touch *touches, uint32_t count, event_list *out)
{
    uint8_t passed[EITS_MAX_TOUCHES] = {0};
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k)
        g->contact[k].flags &= ~(uint32_t)(CONTACT_SEEN | CONTACT_RENAMED);
    for (uint32_t round = 0; round < 3; ++round) {
        for (uint32_t k = 0; k < count; ++k) {
            if (passed[k] || !is_touch(&touches[k]))
                continue;
            const uint32_t place = round == 0   ? of_same_id(g, &touches[k])
                                   : round == 1 ? of_same_place(g, &touches[k])
                                                : NO_CONTACT;
            if (place == NO_CONTACT && round < 2)
                continue;
            passed[k] = 1;
            if (place == NO_CONTACT && touches[k].explained > 0)
                begin_contact(g, &touches[k]);
            else if (place != NO_CONTACT)
                go_on(g, &g->contact[place], &touches[k], out);
        }
    }
}

/* Mark each finger beside another that has been down for longer, or for at least doubt_us: it makes
 * no gesture of one finger. */
static void note_company(eits_gestures *g)
{
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        eits_contact *c = &g->contact[k];
        for (uint32_t l = 0; c->state == CONTACT_DOWN && l < EITS_MAX_CONTACTS; ++l) {
            eits_contact *other = &g->contact[l];
            if (l == k || other->state != CONTACT_DOWN)
                continue;
            const uint32_t age_us = g->time_us - c->born_us, its_us = g->time_us - other->born_us;
            if (its_us > age_us || its_us >= g->options.doubt_us)
                c->flags |= CONTACT_WITH;
        }
    }
}

/* Lift a contact. Its pair ends first, since the pair's last event needs both fingers. */
static void lift(eits_gestures *g, uint32_t place, event_list *out)
{
    eits_contact *c = &g->contact[place];
    eits_pair_lift(g, place, out);
    report_place(g, c, EITS_EVENT_UP, out);
    c->state = CONTACT_LIFTED;
}

/* If a finger is not found and a touch has just appeared near it, the finger is that touch: the
 * tracker lost it, which happens when a finger moves far within a frame. Returns 1 in this case. */
static int is_renamed(eits_gestures *g, eits_contact *c)
{
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        eits_contact *other = &g->contact[k];
        if (other->state != CONTACT_NEW || (other->flags & CONTACT_SEEN) == 0 ||
            eits_distance(other->x_mm - c->x_mm, other->y_mm - c->y_mm) > g->options.rejoin_mm)
            continue;
        const eits_touch touch = {.id = other->touch_id,
                                  .x_mm = other->x_mm,
                                  .y_mm = other->y_mm,
                                  .strength_s_per_m_mm2 = other->strength,
                                  .x_variance_mm2 = other->variance_mm2,
                                  .explained = other->explained};
        note_place(g, c, &touch);
        c->flags |= CONTACT_RENAMED;
        other->state = CONTACT_NONE;
        if (g->time_us - c->born_us > 2 * g->options.doubt_us || (c->flags & CONTACT_GOING) != 0)
            return 1;
        /* the finger has just landed, and its first touch was false */
        c->start_x_mm = c->trail_x_mm[0] = c->x_mm;
        c->start_y_mm = c->trail_y_mm[0] = c->y_mm;
        c->farthest_mm = 0;
        return 1;
    }
    return 0;
}

/* Contacts without a touch in this frame are renamed, lifted after lost_us, and forgotten after
 * rejoin_us. */
static void end_lost(eits_gestures *g, event_list *out)
{
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        eits_contact *c = &g->contact[k];
        const uint32_t since_us = g->time_us - c->seen_us;
        /* noise hides a finger whose place is uncertain in single frames: it has time to come back
         */
        const uint32_t lost_us =
            g->options.lost_us *
            (c->variance_mm2 > EITS_VAGUE_MM * EITS_VAGUE_MM ? EITS_VAGUE_LOST : 1u);
        if ((c->flags & CONTACT_SEEN) != 0 || (c->state == CONTACT_DOWN && is_renamed(g, c)))
            continue;
        if (c->state == CONTACT_DOWN && since_us >= lost_us) {
            lift(g, k, out);
            eits_lifted(g, c, out);
        } else if ((c->state == CONTACT_NEW && since_us >= lost_us) ||
                   (c->state == CONTACT_LIFTED && since_us > g->options.rejoin_us)) {
            c->state = CONTACT_NONE;
        }
    }
}

/* Lift all contacts without reporting a gesture. */
static void begin_again(eits_gestures *g, event_list *out)
{
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        if (g->contact[k].state == CONTACT_DOWN)
            lift(g, k, out);
        /* contacts are forgotten, so that no tap or hold is made of the unobserved time */
        g->contact[k] = (eits_contact){0};
    }
    g->pair = (eits_finger_pair){0};
    g->tapped = 0;
}

eits_status eits_gestures_update(eits_gestures *gestures, const eits_touch *touches, uint32_t count,
                                 uint32_t time_us, eits_event *events, uint32_t room,
                                 uint32_t *reported)
{
    eits_gestures *g = gestures;
    if (g == NULL || reported == NULL || count > EITS_MAX_TOUCHES ||
        (touches == NULL && count > 0) || (events == NULL && room > 0))
        return EITS_E_ARGUMENT;
    event_list out = {.events = events, .room = room, .dropped = &g->dropped};
    const uint32_t elapsed_us = time_us - g->time_us;
    *reported = 0;
    /* A repeated frame is ignored. A clock that goes back is, in unsigned numbers, a long gap, and
     * is treated as one. */
    if (g->begun && elapsed_us == 0)
        return EITS_OK;
    if (g->begun && elapsed_us > EITS_LONGEST_GAP_US)
        begin_again(g, &out);
    g->time_us = time_us;
    g->begun = 1;
    /* Touches are matched before contacts lift, so that a finger under a new id is found before its
     * old contact ends. Pairs and holds come last, since both look at the contacts that remain. */
    match(g, touches, count, &out);
    note_company(g);
    end_lost(g, &out);
    eits_pair_step(g, &out);
    eits_hold(g, &out);
    *reported = out.count;
    return EITS_OK;
}

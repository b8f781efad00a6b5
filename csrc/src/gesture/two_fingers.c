/* Pinch, spread and rotate: the gestures of two fingers.
 *
 * A gesture begins when the distance between the fingers has changed enough, or one has gone far
 * enough round the other. The longer of these two ways decides which gesture it is. A pinch that
 * opens again becomes a spread. */
#include "gesture/two_fingers.h"

#include "gesture/plane.h"

/* Returns 1 for a contact that is down, seen in this frame, and there for long enough that its
 * landing place is known. */
static int is_settled(const eits_gestures *g, const eits_contact *c)
{
    return c->state == CONTACT_DOWN && (c->flags & CONTACT_SEEN) != 0 &&
           g->time_us - c->born_us >= g->options.settle_us;
}

/* Returns the distance between two fingers; never 0, since the caller divides by it. */
static eits_real distance(eits_real dx_mm, eits_real dy_mm)
{
    const eits_real apart = eits_distance(dx_mm, dy_mm);
    return apart > EITS_MIN_APART_MM ? apart : EITS_MIN_APART_MM;
}

/* Report a pair's event. The value is that of the last frame in which both fingers were seen, also
 * at the end: by then one of them lifts, and its place is unreliable. */
static void report_pair(const eits_gestures *g, uint32_t phase, event_list *out)
{
    const eits_finger_pair *p = &g->pair;
    const eits_contact *first = &g->contact[p->first], *second = &g->contact[p->second];
    const eits_real apart = distance(p->dx_mm, p->dy_mm);
    eits_report(out, (eits_event){.kind = p->kind,
                                  .phase = phase,
                                  .first_id = p->first_id,
                                  .second_id = p->second_id,
                                  .time_us = g->time_us,
                                  .x_mm = (first->x_mm + second->x_mm) * R(0.5),
                                  .y_mm = (first->y_mm + second->y_mm) * R(0.5),
                                  .value = p->kind == EITS_EVENT_ROTATE ? p->turned_deg
                                                                        : apart / p->base_mm});
}

/* Begin a pair if exactly two fingers are settled.
 *
 * With a third finger it is unknown which two belong together. */
static void look_for_pair(eits_gestures *g)
{
    uint32_t found[2] = {0, 0}, count = 0;
    for (uint32_t k = 0; k < EITS_MAX_CONTACTS; ++k) {
        if (!is_settled(g, &g->contact[k]))
            continue;
        if (count < 2)
            found[count] = k;
        ++count;
    }
    if (count != 2)
        return;
    const eits_contact *first = &g->contact[found[0]], *second = &g->contact[found[1]];
    const eits_real dx = second->x_mm - first->x_mm, dy = second->y_mm - first->y_mm;
    const eits_real apart = distance(dx, dy);
    g->pair = (eits_finger_pair){.on = 1,
                                 .first = found[0],
                                 .second = found[1],
                                 .first_id = first->id,
                                 .second_id = second->id,
                                 .base_mm = apart,
                                 .base_mm2 = first->variance_mm2 + second->variance_mm2,
                                 .dx_mm = dx,
                                 .dy_mm = dy,
                                 .extreme_mm = apart};
}

/* Begin a gesture. Changes are measured from the value reported last, so that a slow gesture is
 * reported as often as a quick one of the same length. */
static void begin_kind(eits_gestures *g, uint32_t kind, eits_real apart_mm, event_list *out)
{
    eits_finger_pair *p = &g->pair;
    p->kind = kind;
    p->extreme_mm = p->reported_mm = apart_mm;
    p->reported_deg = p->turned_deg;
    report_pair(g, EITS_PHASE_BEGIN, out);
}

/* Returns the way in mm of one finger round the other, for an angle in degrees. */
static eits_real way_round(eits_real degrees, eits_real apart_mm)
{
    return eits_fabs(degrees) * R(0.017453292519943295) * apart_mm;
}

/* Returns how far two fingers must have moved, so that their uncertain places alone do not make a
 * gesture. */
static eits_real least_way(const eits_gestures *g)
{
    const eits_finger_pair *p = &g->pair;
    const eits_real variance_mm2 =
        p->base_mm2 + g->contact[p->first].variance_mm2 + g->contact[p->second].variance_mm2;
    return eits_sqrt(g->options.pair_mm * g->options.pair_mm + EITS_PAIR_NOISE * variance_mm2);
}

/* Both ways are compared in mm, so that one threshold serves: in degrees, noise alone would turn
 * fingers that are near each other. */
static void recognise(eits_gestures *g, eits_real apart_mm, event_list *out)
{
    const eits_finger_pair *p = &g->pair;
    const eits_real least_mm = least_way(g);
    const eits_real along = eits_fabs(apart_mm - p->base_mm);
    const eits_real round = way_round(p->turned_deg, apart_mm);
    if (along < least_mm && round < least_mm)
        return;
    begin_kind(g,
               round > along           ? EITS_EVENT_ROTATE
               : apart_mm < p->base_mm ? EITS_EVENT_PINCH
                                       : EITS_EVENT_SPREAD,
               apart_mm, out);
}

static void go_on(eits_gestures *g, eits_real apart_mm, event_list *out)
{
    eits_finger_pair *p = &g->pair;
    const int pinch = p->kind == EITS_EVENT_PINCH, rotate = p->kind == EITS_EVENT_ROTATE;
    /* the way back is measured from the farthest point, not from the start: a wide pinch may open a
     * little and still be a pinch */
    const eits_real back = pinch ? apart_mm - p->extreme_mm : p->extreme_mm - apart_mm;
    if (!rotate && back >= least_way(g)) {
        report_pair(g, EITS_PHASE_END, out);
        /* the new gesture's value begins at 1 where it turned round */
        p->base_mm = p->extreme_mm;
        begin_kind(g, pinch ? EITS_EVENT_SPREAD : EITS_EVENT_PINCH, apart_mm, out);
        return;
    }
    p->extreme_mm = back < 0 ? apart_mm : p->extreme_mm;
    const eits_real moved = rotate ? way_round(p->turned_deg - p->reported_deg, apart_mm)
                                   : eits_fabs(apart_mm - p->reported_mm);
    if (moved < g->options.move_mm)
        return;
    p->reported_mm = apart_mm;
    p->reported_deg = p->turned_deg;
    report_pair(g, EITS_PHASE_CHANGE, out);
}

/* Continue a gesture whose finger was lost for a frame and found again. Returns 1 if there is one.
 */
static int take_up(eits_gestures *g)
{
    eits_finger_pair *p = &g->pair;
    const eits_contact *first = &g->contact[p->first], *second = &g->contact[p->second];
    p->on = p->kind != 0 && first->state == CONTACT_DOWN && second->state == CONTACT_DOWN &&
            first->id == p->first_id && second->id == p->second_id;
    return (int)p->on;
}

void eits_pair_step(eits_gestures *g, event_list *out)
{
    eits_finger_pair *p = &g->pair;
    if (!p->on && !take_up(g)) {
        look_for_pair(g);
        return;
    }
    const eits_contact *first = &g->contact[p->first], *second = &g->contact[p->second];
    /* A finger that was missed still has its old place; using it would show half of a movement. */
    if ((first->flags & second->flags & CONTACT_SEEN) == 0)
        return;
    const eits_real dx = second->x_mm - first->x_mm, dy = second->y_mm - first->y_mm;
    if (((first->flags | second->flags) & CONTACT_RENAMED) != 0 && p->kind == 0) {
        p->on = 0; /* the fingers' starting places are unknown */
        return;
    }
    /* Cross and dot product of the last line and this one give the small angle between them. Small
     * angles add up beyond 180 degrees; an angle from the x axis would jump there. */
    p->turned_deg += eits_angle_deg(p->dx_mm * dy - p->dy_mm * dx, p->dx_mm * dx + p->dy_mm * dy);
    p->dx_mm = dx;
    p->dy_mm = dy;
    if (p->kind == 0)
        recognise(g, distance(dx, dy), out);
    else
        go_on(g, distance(dx, dy), out);
}

void eits_pair_lift(eits_gestures *g, uint32_t place, event_list *out)
{
    eits_finger_pair *p = &g->pair;
    if (!p->on || (place != p->first && place != p->second))
        return;
    if (p->kind != 0)
        report_pair(g, EITS_PHASE_END, out);
    p->on = 0;
}

/* Events from touches in time: every kind, and what real frames do to them. */
#include "check.h"

#include "eitskin/gesture.h"

#include <math.h>
#include <string.h>

enum { FRAME_US = 20833, ROOM = EITS_MAX_EVENTS, KEPT = 4096 };

/* A stream of frames at 48 a second, and all that was told of it but moves. */
typedef struct bench {
    eits_gestures g;
    uint32_t now_us, count, moves;
    eits_event told[KEPT];
} bench;

static bench b;

static void begin(bench *b)
{
    b->now_us = 0xFFFF0000u; /* the clock wraps on the way */
    b->count = b->moves = 0;
    CHECK_EQUAL(eits_gestures_init(&b->g, NULL), EITS_OK);
}

static void keep(bench *b, const eits_event *events, uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) {
        CHECK(isfinite((double)events[k].x_mm) && isfinite((double)events[k].y_mm) &&
              isfinite((double)events[k].direction_deg) && isfinite((double)events[k].value));
        b->moves += events[k].kind == EITS_EVENT_MOVE;
        if (events[k].kind != EITS_EVENT_MOVE && b->count < KEPT)
            b->told[b->count++] = events[k];
    }
}

static void frame(bench *b, const eits_touch *touches, uint32_t count)
{
    eits_event events[ROOM];
    uint32_t told = 99;
    CHECK_EQUAL(eits_gestures_update(&b->g, touches, count, b->now_us, events, ROOM, &told),
                EITS_OK);
    b->now_us += FRAME_US;
    keep(b, events, told);
}

static eits_touch touch(uint32_t id, double x, double y)
{
    return (eits_touch){.id = id,
                        .x_mm = (eits_real)x,
                        .y_mm = (eits_real)y,
                        .radius_mm = 8,
                        .strength_s_per_m_mm2 = 3,
                        .explained = (eits_real)0.9};
}

static void none(bench *b, int frames)
{
    for (int k = 0; k < frames; ++k)
        frame(b, NULL, 0);
}

/* One finger from (x, y) by so much a frame. */
static void finger(bench *b, uint32_t id, double x, double y, double dx, double dy, int frames)
{
    for (int k = 0; k < frames; ++k) {
        const eits_touch t = touch(id, x + dx * k, y + dy * k);
        frame(b, &t, 1);
    }
}

/* Two fingers, each along a straight line. */
static void fingers(bench *b, const double from[4], const double by[4], int frames)
{
    for (int k = 0; k < frames; ++k) {
        const eits_touch two[] = {touch(1, from[0] + by[0] * k, from[1] + by[1] * k),
                                  touch(2, from[2] + by[2] * k, from[3] + by[3] * k)};
        frame(b, two, 2);
    }
}

/* How often a kind was told, in a phase. */
static int count_of(const bench *b, eits_event_kind kind, eits_event_phase phase)
{
    int count = 0;
    for (uint32_t k = 0; k < b->count; ++k)
        count += b->told[k].kind == (uint32_t)kind && b->told[k].phase == (uint32_t)phase;
    return count;
}

static int once(const bench *b, eits_event_kind kind)
{
    return count_of(b, kind, EITS_PHASE_ONCE);
}

/* Gestures of every kind, changes left out. */
static int gestures(const bench *b)
{
    int count = 0;
    for (uint32_t k = 0; k < b->count; ++k)
        count += b->told[k].kind > EITS_EVENT_UP && b->told[k].phase <= EITS_PHASE_BEGIN;
    return count;
}

static const eits_event *last(const bench *b, eits_event_kind kind)
{
    static const eits_event nothing;
    for (uint32_t k = b->count; k-- > 0;) {
        if (b->told[k].kind == (uint32_t)kind)
            return &b->told[k];
    }
    return &nothing;
}

/* ---- one finger ---- */

TEST(a_tap_is_told_in_the_first_frame_without_it)
{
    begin(&b);
    none(&b, 2);
    finger(&b, 7, 10, -20, 0, 0, 5);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 1);
    CHECK_EQUAL(b.told[0].time_us, 0xFFFF0000u + 3 * FRAME_US); /* once it has lasted a frame */
    none(&b, 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 1);
    CHECK_EQUAL(last(&b, EITS_EVENT_TAP)->first_id, 7);
    CHECK_NEAR(last(&b, EITS_EVENT_TAP)->x_mm, 10, 1e-6);
    CHECK_NEAR(last(&b, EITS_EVENT_TAP)->y_mm, -20, 1e-6);
    none(&b, 20);
    CHECK_EQUAL(gestures(&b), 1);
}

TEST(two_taps_soon_and_near_are_a_double_tap_and_a_third_is_a_first)
{
    begin(&b);
    b.now_us = 10000000; /* what counts is the time between them */
    for (uint32_t k = 1; k <= 3; ++k) {
        finger(&b, k, 10 + k, 0, 0, 0, 4);
        none(&b, 6);
    }
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 2);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOUBLE_TAP), 1);
    CHECK_EQUAL(last(&b, EITS_EVENT_DOUBLE_TAP)->first_id, 2);
    begin(&b);
    finger(&b, 1, 0, 0, 0, 0, 4);
    none(&b, 6);
    finger(&b, 2, 40, 0, 0, 0, 4); /* elsewhere */
    none(&b, 16);
    finger(&b, 3, 40, 0, 0, 0, 4); /* too late */
    none(&b, 2);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOUBLE_TAP), 0);
}

TEST(a_long_press_is_a_hold_once_and_no_tap)
{
    begin(&b);
    finger(&b, 1, 5, 5, 0, 0, 24);
    CHECK_EQUAL(once(&b, EITS_EVENT_HOLD), 0);
    finger(&b, 1, 5, 5, 0, 0, 2); /* the 25th frame is 0.5 s after the first */
    CHECK_EQUAL(once(&b, EITS_EVENT_HOLD), 1);
    CHECK_NEAR(last(&b, EITS_EVENT_HOLD)->value, 0.5, 0.03);
    finger(&b, 1, 5, 5, 0, 0, 30);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
    begin(&b);
    finger(&b, 1, 5, 5, 0, 0, 18); /* too long for a tap, too short for a hold */
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 0);
}

TEST(a_swipe_says_where_it_goes)
{
    for (int side = 0; side < 8; ++side) {
        const double angle = 3.14159265358979 * side / 4;
        begin(&b);
        finger(&b, 1, 0, 0, 6 * cos(angle), 6 * sin(angle), 10);
        none(&b, 3);
        CHECK_EQUAL(gestures(&b), 1);
        CHECK_NEAR(last(&b, EITS_EVENT_SWIPE)->direction_deg, 45 * side, 0.01);
        CHECK_NEAR(last(&b, EITS_EVENT_SWIPE)->value, 48, 0.01); /* from its second frame on */
        CHECK(b.moves >= 8);
    }
}

TEST(what_ends_at_rest_or_comes_back_is_no_swipe)
{
    begin(&b);
    finger(&b, 1, 0, 0, 6, 0, 10);
    finger(&b, 1, 54, 0, 0, 0, 6);
    none(&b, 3);
    begin(&b);
    finger(&b, 1, 0, 0, 6, 0, 12);
    finger(&b, 1, 66, 0, -6, 0, 8);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 0);
    begin(&b);
    finger(&b, 1, 0, 0, 2.5, 0, 7); /* 12.5 mm: more than a tap, less than a swipe */
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 0);
    begin(&b);
    finger(&b, 1, 0, 0, 2, 0, 60); /* too long */
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 0);
}

/* ---- two fingers ---- */

TEST(two_fingers_pinch_and_the_end_says_by_how_much)
{
    begin(&b);
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){2, 0, -2, 0}, 20);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_BEGIN), 1);
    CHECK(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_CHANGE) > 5);
    none(&b, 1);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_END), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 2);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
    const eits_event *end = last(&b, EITS_EVENT_PINCH);
    CHECK_EQUAL(end->first_id, 1);
    CHECK_EQUAL(end->second_id, 2);
    CHECK_NEAR(end->value, 24.0 / 96.0, 1e-5); /* of the second frame's distance */
    CHECK_NEAR(end->x_mm, 0, 1e-5);
}

TEST(a_pinch_that_opens_again_becomes_a_spread)
{
    begin(&b);
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){2, 0, -2, 0}, 16);
    fingers(&b, (double[]){-20, 0, 20, 0}, (double[]){-2, 0, 2, 0}, 16);
    none(&b, 3);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_BEGIN), 1);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_END), 1);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_SPREAD, EITS_PHASE_BEGIN), 1);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_SPREAD, EITS_PHASE_END), 1);
    CHECK_NEAR(last(&b, EITS_EVENT_SPREAD)->value, 100.0 / 40.0, 1e-5);
    begin(&b);
    fingers(&b, (double[]){-20, 0, 20, 0}, (double[]){-2, 0, 2, 0}, 16);
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){2, 0, -2, 0}, 16);
    none(&b, 3);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_SPREAD, EITS_PHASE_END), 1);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_END), 1);
}

TEST(two_fingers_turn_either_way)
{
    for (int way = -1; way <= 1; way += 2) {
        begin(&b);
        for (int k = 0; k < 40; ++k) {
            const double angle = 3.0 + way * 0.08 * k;
            const eits_touch two[] = {touch(1, 30 * cos(angle), 30 * sin(angle)),
                                      touch(2, -30 * cos(angle), -30 * sin(angle))};
            frame(&b, two, 2);
        }
        none(&b, 3);
        CHECK_EQUAL(gestures(&b), 1);
        CHECK(count_of(&b, EITS_EVENT_ROTATE, EITS_PHASE_CHANGE) > 5);
        CHECK_EQUAL(count_of(&b, EITS_EVENT_ROTATE, EITS_PHASE_END), 1);
        CHECK_NEAR(last(&b, EITS_EVENT_ROTATE)->value, way * 0.08 * 38 * 57.29578, 0.05);
    }
}

/* A change is told for each so much of way, not for each frame: 0.6 mm here, of 72. */
TEST(a_slow_turn_is_told_by_its_way)
{
    begin(&b);
    for (int k = 0; k < 120; ++k) {
        const double angle = 3.0 + 0.01 * k;
        const eits_touch two[] = {touch(1, 30 * cos(angle), 30 * sin(angle)),
                                  touch(2, -30 * cos(angle), -30 * sin(angle))};
        frame(&b, two, 2);
    }
    CHECK(count_of(&b, EITS_EVENT_ROTATE, EITS_PHASE_CHANGE) > 8);
    CHECK(count_of(&b, EITS_EVENT_ROTATE, EITS_PHASE_CHANGE) < 80);
}

TEST(fingers_that_rest_or_are_three_do_nothing_together)
{
    begin(&b);
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){0, 0, 0, 0}, 40);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 0);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 2);
    begin(&b);
    for (int k = 0; k < 20; ++k) {
        const eits_touch three[] = {touch(1, -50 + 2 * k, 0), touch(2, 50 - 2 * k, 0),
                                    touch(3, 0, 70)};
        frame(&b, three, 3);
    }
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 0);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 3);
}

/* ---- real frames ---- */

TEST(a_scan_that_a_finger_lands_in_invents_nothing)
{
    begin(&b);
    const eits_touch two[] = {touch(1, -8, 3), touch(2, -37, -9)};
    frame(&b, two, 2);
    finger(&b, 2, -30, -4, 0, 0, 6);
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 1);
    CHECK_NEAR(last(&b, EITS_EVENT_TAP)->x_mm, -30, 1e-6);
}

TEST(a_scan_that_a_finger_lifts_in_does_not_move_it)
{
    begin(&b);
    finger(&b, 1, 40, 59, 0, 0, 12);
    eits_touch going = touch(1, 28, 50);
    going.strength_s_per_m_mm2 = (eits_real)1.8;
    frame(&b, &going, 1);
    CHECK_EQUAL(b.moves, 0);
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 1);
    CHECK_NEAR(last(&b, EITS_EVENT_UP)->x_mm, 40, 1e-6);
    begin(&b);
    finger(&b, 1, 40, 59, 0, 0, 6);
    frame(&b, &going, 1);
    going.explained = 0; /* held by the tracker: it has lifted */
    frame(&b, &going, 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 1);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
}

TEST(a_lighter_press_is_followed_on)
{
    begin(&b);
    finger(&b, 1, 0, 0, 0, 0, 4);
    for (int k = 0; k < 12; ++k) {
        eits_touch light = touch(1, 4 * k, 0);
        light.strength_s_per_m_mm2 = (eits_real)1.5;
        frame(&b, &light, 1);
    }
    CHECK(b.moves > 4);
    none(&b, 2);
    CHECK_EQUAL(once(&b, EITS_EVENT_SWIPE), 1);
}

TEST(a_held_touch_and_a_lost_frame_do_not_end_a_hold)
{
    begin(&b);
    finger(&b, 1, 5, 5, 0, 0, 8);
    eits_touch held = touch(1, 9, 9);
    held.explained = 0;
    frame(&b, &held, 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 0);
    CHECK_EQUAL(b.moves, 0); /* where the tracker holds it says nothing of where it is */
    finger(&b, 1, 5, 5, 0, 0, 7);
    none(&b, 1); /* more than a tap was: nothing is told of the false lift but up */
    finger(&b, 1, 5, 5, 0, 0, 12);
    CHECK_EQUAL(once(&b, EITS_EVENT_HOLD), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 2);
    CHECK_EQUAL(b.told[b.count - 1].first_id, 1);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
}

TEST(a_tap_that_is_found_again_is_told_once)
{
    begin(&b);
    finger(&b, 1, 5, 5, 0, 0, 4);
    none(&b, 1);
    finger(&b, 1, 5, 5, 0, 0, 4);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
    begin(&b); /* and so is a swipe whose tail the tracker calls by another id */
    finger(&b, 1, 0, 0, 8, 0, 8);
    none(&b, 1);
    finger(&b, 2, 72, 0, 8, 0, 3);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_SWIPE), 1);
}

TEST(another_id_is_the_same_finger)
{
    begin(&b);
    finger(&b, 1, 0, 0, 6, 0, 5);
    finger(&b, 9, 30, 0, 6, 0, 5);
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_SWIPE), 1);
    CHECK_EQUAL(last(&b, EITS_EVENT_SWIPE)->first_id, 1);
    begin(&b); /* both ids in one frame */
    finger(&b, 1, 0, 0, 6, 0, 5);
    const eits_touch both[] = {touch(1, 24, 0), touch(9, 36, 0)};
    frame(&b, both, 2);
    finger(&b, 9, 42, 0, 6, 0, 4);
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 1);
    CHECK_EQUAL(gestures(&b), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_SWIPE), 1);
}

TEST(half_of_a_touch_is_no_finger_until_it_has_lasted)
{
    begin(&b);
    finger(&b, 1, 0, 0, 0, 0, 6);
    const eits_touch split[] = {touch(1, -6, 0), touch(2, 8, 0)};
    frame(&b, split, 2);
    frame(&b, split, 2);
    finger(&b, 1, 0, 0, 0, 0, 2);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 1);
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 1);
    begin(&b);
    finger(&b, 1, 0, 0, 0, 0, 6);
    eits_touch two[] = {touch(1, 0, 0), touch(2, 60, 0)};
    two[1].strength_s_per_m_mm2 = (eits_real)0.1; /* a ghost of the strong one */
    frame(&b, two, 2);
    frame(&b, two, 2);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 1);
    frame(&b, two, 2);
    frame(&b, two, 2);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 2);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 0);
}

/* The tracker calls what it lands as by another id, a while later. */
TEST(a_landing_that_is_renamed_holds_where_it_rests)
{
    begin(&b);
    finger(&b, 1, 20, 57, 0, 0, 1);
    const eits_touch both[] = {touch(1, 14, 62), touch(2, 12, 44)};
    frame(&b, both, 2);
    finger(&b, 2, 11, 51, 0, 0, 30);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_HOLD), 1);
    CHECK_NEAR(last(&b, EITS_EVENT_HOLD)->x_mm, 11, 1e-6);
    for (int moved = 0; moved < 2; ++moved) { /* how still it is counts from there on */
        begin(&b);
        b.g.options.still_mm = (eits_real)0.5;
        finger(&b, 1, 20, 57, 0, 0, 1);
        frame(&b, both, 2);
        finger(&b, 2, 11, 51, moved ? 0.1 : 0, 0, 30);
        CHECK_EQUAL(once(&b, EITS_EVENT_HOLD), !moved);
    }
    begin(&b); /* of two fingers one: they begin where it is then */
    for (int k = 0; k < 12; ++k) {
        const eits_touch two[] = {touch(k < 4 ? 2 : 3, 60, 0), touch(1, k < 4 ? 15 : 0, 0)};
        const eits_touch three[] = {touch(3, 55, 10), touch(2, 65, 0), touch(1, 15, 0)};
        frame(&b, k == 3 ? three : two, k == 3 ? 3 : 2);
    }
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 2);
    CHECK_EQUAL(gestures(&b), 0);
}

TEST(a_swipe_of_two_frames_counts_the_one_it_lifts_in)
{
    begin(&b);
    finger(&b, 1, 0, 0, 10, 0, 2);
    eits_touch going = touch(1, 32, 0);
    going.strength_s_per_m_mm2 = 2;
    frame(&b, &going, 1);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
    CHECK_NEAR(last(&b, EITS_EVENT_SWIPE)->value, 22, 1e-5);
    begin(&b); /* not believed: it lets go of at once what it landed at */
    finger(&b, 1, 0, 0, 0, 0, 1);
    going.x_mm = 0;
    frame(&b, &going, 1);
    going.strength_s_per_m_mm2 = 1;
    frame(&b, &going, 1);
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 1);
    begin(&b);
    finger(&b, 1, 0, 0, 0, 0, 1);
    going.x_mm = 60;
    frame(&b, &going, 1);
    none(&b, 3);
    CHECK_EQUAL(once(&b, EITS_EVENT_TAP), 0);
}

TEST(fingers_that_merge_end_their_pinch)
{
    begin(&b);
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){2, 0, -2, 0}, 20);
    finger(&b, 1, 0, 0, 0, 0, 10);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_END), 1);
}

TEST(a_pair_that_is_not_found_for_a_frame_goes_on)
{
    begin(&b);
    b.g.options.lost_us = 30000;
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){2, 0, -2, 0}, 12);
    finger(&b, 1, -26, 0, 0, 0, 1);
    fingers(&b, (double[]){-24, 0, 24, 0}, (double[]){1, 0, -1, 0}, 8);
    none(&b, 3);
    CHECK_EQUAL(gestures(&b), 1);
}

/* ---- limits and hostile numbers ---- */

TEST(events_without_room_are_counted)
{
    eits_event few[2];
    uint32_t told;
    eits_touch many[EITS_MAX_TOUCHES];
    begin(&b);
    for (uint32_t k = 0; k < EITS_MAX_TOUCHES; ++k)
        many[k] = touch(k + 1, 60.0 * (k % 4), 60.0 * (k / 4));
    frame(&b, many, EITS_MAX_TOUCHES);
    CHECK_EQUAL(eits_gestures_update(&b.g, many, EITS_MAX_TOUCHES, b.now_us, few, 2, &told),
                EITS_OK);
    CHECK_EQUAL(told, 2);
    CHECK_EQUAL(few[1].kind, EITS_EVENT_DOWN);
    CHECK_EQUAL(b.g.dropped, EITS_MAX_TOUCHES - 2);
    CHECK_EQUAL(eits_gestures_update(&b.g, NULL, 0, b.now_us + FRAME_US, NULL, 0, &told), EITS_OK);
    CHECK_EQUAL(told, 0);
    CHECK_EQUAL(b.g.dropped, 2 * EITS_MAX_TOUCHES - 2);
}

TEST(more_fingers_than_can_be_followed_are_counted)
{
    eits_touch many[EITS_MAX_TOUCHES];
    begin(&b);
    b.g.options.lost_us = 500000;
    for (uint32_t round = 0; round < 3; ++round) { /* each time others, the old ones waited for */
        for (uint32_t k = 0; k < EITS_MAX_TOUCHES; ++k)
            many[k] = touch(100 * round + k + 1, 1000.0 * round + 60.0 * k, 0);
        frame(&b, many, EITS_MAX_TOUCHES);
        frame(&b, many, EITS_MAX_TOUCHES);
    }
    CHECK_EQUAL(b.g.dropped, 2 * EITS_MAX_TOUCHES);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), EITS_MAX_CONTACTS);
    none(&b, 60); /* and all lift in one frame */
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), EITS_MAX_CONTACTS);
    CHECK_EQUAL(b.g.dropped, 2 * EITS_MAX_TOUCHES);
}

TEST(the_place_of_what_lifted_first_is_taken)
{
    eits_touch many[EITS_MAX_TOUCHES];
    begin(&b);
    b.g.options.rejoin_us = 500000;
    for (uint32_t round = 0; round < 4; ++round) {
        for (uint32_t k = 0; k < EITS_MAX_TOUCHES; ++k)
            many[k] = touch(100 * round + k + 1, 1000.0 * round + 60.0 * k, 0);
        frame(&b, many, EITS_MAX_TOUCHES);
        frame(&b, many, EITS_MAX_TOUCHES);
        none(&b, 1);
    }
    CHECK_EQUAL(b.g.dropped, 0);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 4 * EITS_MAX_TOUCHES);
}

TEST(what_is_no_number_is_passed_over)
{
    begin(&b);
    for (int k = 0; k < 6; ++k) {
        eits_touch bad[] = {touch(1, NAN, 0),   touch(2, 0, INFINITY), touch(3, 1e30, 0),
                            touch(4, 0, -1e30), touch(5, 0, 0),        touch(6, 20, 20)};
        bad[4].strength_s_per_m_mm2 = (eits_real)NAN;
        bad[5].explained = (eits_real)NAN;
        frame(&b, bad, 6);
    }
    none(&b, 2);
    CHECK_EQUAL(once(&b, EITS_EVENT_DOWN), 0);
    begin(&b);
    for (int k = 0; k < 30; ++k) { /* fingers at one place, and at the ends of the world */
        const eits_touch odd[] = {touch(1, k % 2 ? 1e6 : -1e6, 1e6), touch(1, 0, 0),
                                  touch(0, 0, 0)};
        frame(&b, odd, (uint32_t)(k % 4));
    }
    begin(&b);
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){5, 0, -5, 0}, 11); /* to one place */
    fingers(&b, (double[]){0, 0, 0, 0}, (double[]){-5, 0, 5, 0}, 11);
    none(&b, 3);
    CHECK_EQUAL(count_of(&b, EITS_EVENT_SPREAD, EITS_PHASE_END), 1);
}

TEST(time_that_stands_goes_back_or_leaps)
{
    begin(&b);
    finger(&b, 1, 0, 0, 0, 0, 4);
    b.now_us -= FRAME_US; /* the same frame again */
    finger(&b, 1, 50, 0, 0, 0, 1);
    CHECK_EQUAL(b.moves, 0);
    b.now_us -= 100 * FRAME_US;
    none(&b, 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 1);
    CHECK_EQUAL(gestures(&b), 0);
    fingers(&b, (double[]){-50, 0, 50, 0}, (double[]){2, 0, -2, 0}, 20);
    b.now_us += 2000000;
    none(&b, 1);
    CHECK_EQUAL(once(&b, EITS_EVENT_UP), 3);
    CHECK_EQUAL(gestures(&b), 1); /* the pinch had begun */
    CHECK_EQUAL(count_of(&b, EITS_EVENT_PINCH, EITS_PHASE_END), 1);
}

TEST(wrong_arguments_are_refused)
{
    eits_event events[1];
    eits_gesture_options options;
    uint32_t told;
    const eits_touch t = touch(1, 0, 0);
    begin(&b);
    CHECK_EQUAL(eits_gestures_usual(NULL), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_gestures_init(NULL, NULL), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_gestures_usual(&options), EITS_OK);
    CHECK_EQUAL(eits_gestures_init(&b.g, &options), EITS_OK);
    options.split_mm = (eits_real)NAN;
    CHECK_EQUAL(eits_gestures_init(&b.g, &options), EITS_E_ARGUMENT);
    options.split_mm = -1;
    CHECK_EQUAL(eits_gestures_init(&b.g, &options), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_gestures_update(NULL, &t, 1, 0, events, 1, &told), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_gestures_update(&b.g, NULL, 1, 0, events, 1, &told), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_gestures_update(&b.g, &t, EITS_MAX_TOUCHES + 1, 0, events, 1, &told),
                EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_gestures_update(&b.g, &t, 1, 0, NULL, 1, &told), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_gestures_update(&b.g, &t, 1, 0, events, 1, NULL), EITS_E_ARGUMENT);
}

RUN_TESTS("gesture")

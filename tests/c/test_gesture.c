/* Events from touches in time: every kind, and what real frames do to them. */
#include "check.h"

#include "eitskin/gesture.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { FRAME_US = 20833, ROOM = EITS_MAX_EVENTS, KEPT = 4096 };

/* A stream of frames at 48 a second, and all that was reported of it but moves. */
typedef struct bench {
    eits_gestures g;
    uint32_t now_us, count, moves;
    eits_event reported[KEPT];
} bench;

static bench b;

static void begin(void)
{
    b.now_us = 0xFFFF0000u; /* the clock wraps on the way */
    b.count = b.moves = 0;
    CHECK_OK(eits_gestures_init(&b.g, NULL));
}

static void keep(const eits_event *events, uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) {
        CHECK(isfinite((double)events[k].x_mm) && isfinite((double)events[k].y_mm) &&
              isfinite((double)events[k].direction_deg) && isfinite((double)events[k].value));
        b.moves += events[k].kind == EITS_EVENT_MOVE;
        if (events[k].kind != EITS_EVENT_MOVE && b.count < KEPT)
            b.reported[b.count++] = events[k];
    }
}

static void frame(const eits_touch *touches, uint32_t count)
{
    eits_event events[ROOM];
    uint32_t reported = 99;
    CHECK_OK(eits_gestures_update(&b.g, touches, count, b.now_us, events, ROOM, &reported));
    b.now_us += FRAME_US;
    keep(events, reported);
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

static void none(int frames)
{
    for (int k = 0; k < frames; ++k)
        frame(NULL, 0);
}

/* One finger from (x, y) by so much a frame. */
static void finger(uint32_t id, double x, double y, double dx, double dy, int frames)
{
    for (int k = 0; k < frames; ++k) {
        const eits_touch t = touch(id, x + dx * k, y + dy * k);
        frame(&t, 1);
    }
}

/* Two fingers, each along a straight line. */
static void fingers(const double from[4], const double by[4], int frames)
{
    for (int k = 0; k < frames; ++k) {
        const eits_touch two[] = {touch(1, from[0] + by[0] * k, from[1] + by[1] * k),
                                  touch(2, from[2] + by[2] * k, from[3] + by[3] * k)};
        frame(two, 2);
    }
}

/* How often a kind was reported, in a phase. */
static int count_of(eits_event_kind kind, eits_event_phase phase)
{
    int count = 0;
    for (uint32_t k = 0; k < b.count; ++k)
        count += b.reported[k].kind == (uint32_t)kind && b.reported[k].phase == (uint32_t)phase;
    return count;
}

/* All that was reported, moves and changes left out: "2 down, up, pinch begins". */
static const char *story(void)
{
    static const char *const kinds[] = {
        [EITS_EVENT_DOWN] = "down",    [EITS_EVENT_UP] = "up",
        [EITS_EVENT_TAP] = "tap",      [EITS_EVENT_DOUBLE_TAP] = "double tap",
        [EITS_EVENT_HOLD] = "hold",    [EITS_EVENT_SWIPE] = "swipe",
        [EITS_EVENT_PINCH] = "pinch",  [EITS_EVENT_SPREAD] = "spread",
        [EITS_EVENT_ROTATE] = "rotate"};
    static const eits_event_phase phases[] = {EITS_PHASE_ONCE, EITS_PHASE_BEGIN, EITS_PHASE_END};
    static const char *const ends[] = {"", " begins", " ends"};
    static char text[400];
    size_t at = 0;
    text[0] = 0;
    for (uint32_t k = 0; k < 3 * COUNT_OF(kinds); ++k) {
        const int count = count_of((eits_event_kind)(k / 3), phases[k % 3]);
        char times[16] = "";
        if (count == 0 || kinds[k / 3] == NULL)
            continue;
        if (count > 1)
            (void)snprintf(times, sizeof times, "%d ", count);
        at += (size_t)snprintf(text + at, sizeof text - at, "%s%s%s%s", at > 0 ? ", " : "", times,
                               kinds[k / 3], ends[k % 3]);
    }
    return text;
}

static void check_story(const char *expected, const char *file, int line)
{
    const char *got = story();
    if (check_counts(strcmp(got, expected) == 0, file, line))
        printf(": reported \"%s\", expected \"%s\"\n", got, expected);
}
/* So far; and once the fingers have gone for a while. */
#define REPORTS(expected) check_story(expected, __FILE__, __LINE__)
#define ENDS(expected)    (none(3), check_story(expected, __FILE__, __LINE__))

static const eits_event *last(eits_event_kind kind)
{
    static const eits_event nothing;
    for (uint32_t k = b.count; k-- > 0;) {
        if (b.reported[k].kind == (uint32_t)kind)
            return &b.reported[k];
    }
    return &nothing;
}

/* ---- one finger ---- */

TEST(a_tap_is_reported_in_the_first_frame_without_it)
{
    begin();
    none(2);
    finger(7, 10, -20, 0, 0, 5);
    REPORTS("down");
    CHECK_EQUAL(b.reported[0].time_us, 0xFFFF0000u + 3 * FRAME_US); /* once it has lasted a frame */
    none(1);
    REPORTS("down, up, tap");
    CHECK_EQUAL(last(EITS_EVENT_TAP)->first_id, 7);
    CHECK_NEAR(last(EITS_EVENT_TAP)->x_mm, 10, 1e-6);
    CHECK_NEAR(last(EITS_EVENT_TAP)->y_mm, -20, 1e-6);
    none(17);
    ENDS("down, up, tap");
}

TEST(a_light_tap_of_two_frames_is_a_tap)
{
    eits_touch light = touch(1, 5, 5);
    light.explained = (eits_real)0.2;
    begin();
    frame(&light, 1);
    frame(&light, 1);
    ENDS("down, up, tap");
}

TEST(two_taps_soon_and_near_are_a_double_tap_and_a_third_is_a_first)
{
    begin();
    b.now_us = 10000000; /* what counts is the time between them */
    for (uint32_t k = 1; k <= 3; ++k) {
        finger(k, 10 + k, 0, 0, 0, 4);
        none(6);
    }
    REPORTS("3 down, 3 up, 2 tap, double tap");
    CHECK_EQUAL(last(EITS_EVENT_DOUBLE_TAP)->first_id, 2);
    begin();
    finger(1, 0, 0, 0, 0, 4);
    none(6);
    finger(2, 40, 0, 0, 0, 4); /* elsewhere */
    none(16);
    finger(3, 40, 0, 0, 0, 4); /* too late */
    ENDS("3 down, 3 up, 3 tap");
}

TEST(a_long_press_is_a_hold_once_and_no_tap)
{
    begin();
    finger(1, 5, 5, 0, 0, 24);
    REPORTS("down");
    finger(1, 5, 5, 0, 0, 2); /* the 25th frame is 0.5 s after the first */
    REPORTS("down, hold");
    CHECK_NEAR(last(EITS_EVENT_HOLD)->value, 0.5, 0.03);
    finger(1, 5, 5, 0, 0, 30);
    ENDS("down, up, hold");
    begin();
    finger(1, 5, 5, 0, 0, 18); /* too long for a tap, too short for a hold */
    ENDS("down, up");
}

TEST(a_swipe_says_where_it_goes)
{
    for (int side = 0; side < 8; ++side) {
        const double angle = 3.14159265358979 * side / 4;
        begin();
        finger(1, 0, 0, 6 * cos(angle), 6 * sin(angle), 10);
        ENDS("down, up, swipe");
        CHECK_NEAR(last(EITS_EVENT_SWIPE)->direction_deg, 45 * side, 0.01);
        CHECK_NEAR(last(EITS_EVENT_SWIPE)->value, 48, 0.01); /* from its second frame on */
        CHECK(b.moves >= 8);
    }
}

TEST(what_ends_at_rest_or_comes_back_is_no_swipe)
{
    static const struct {
        double dx, then_from, then_dx;
        int frames, then_frames;
    } cases[] = {{6, 54, 0, 10, 6},
                 {6, 66, -6, 12, 8},
                 {2.5, 0, 0, 7, 0}, /* 12.5 mm: more than a tap, less than a swipe */
                 {2, 0, 0, 60, 0}}; /* too long */
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        begin();
        finger(1, 0, 0, cases[k].dx, 0, cases[k].frames);
        finger(1, cases[k].then_from, 0, cases[k].then_dx, 0, cases[k].then_frames);
        ENDS("down, up");
    }
}

TEST(the_noise_of_a_place_at_rest_is_no_swipe)
{
    begin();
    finger(1, 0, 0, 6, 0, 10);
    finger(1, 54, 0, 0, 0, 7);
    finger(1, 60, 0, 0, 0, 1);
    ENDS("down, up");
}

/* ---- two fingers ---- */

/* Along the x axis, each so far from the middle at first, by so much a frame. */
static void pair(double from, double by, int frames)
{
    fingers((double[]){-from, 0, from, 0}, (double[]){by, 0, -by, 0}, frames);
}

TEST(two_fingers_pinch_and_the_end_says_by_how_much)
{
    begin();
    pair(50, 2, 20);
    REPORTS("2 down, pinch begins");
    CHECK(count_of(EITS_EVENT_PINCH, EITS_PHASE_CHANGE) > 5);
    none(1);
    REPORTS("2 down, 2 up, pinch begins, pinch ends");
    ENDS("2 down, 2 up, pinch begins, pinch ends");
    const eits_event *end = last(EITS_EVENT_PINCH);
    CHECK_EQUAL(end->first_id, 1);
    CHECK_EQUAL(end->second_id, 2);
    CHECK_NEAR(end->value, 24.0 / 96.0, 1e-5); /* of the second frame's distance */
    CHECK_NEAR(end->x_mm, 0, 1e-5);
}

TEST(fingers_at_uncertain_places_must_move_further)
{
    static const struct {
        double variance_mm2, by;
        const char *reported;
    } cases[] = {
        {0, 10, "2 down, pinch begins"}, {25, 10, "2 down"}, {25, 14, "2 down, pinch begins"}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        begin();
        for (int n = 0; n < 8; ++n) {
            const double x = n < 4 ? 50 : 50 - cases[k].by;
            eits_touch two[] = {touch(1, -x, 0), touch(2, x, 0)};
            for (int f = 0; f < 2; ++f)
                two[f].x_variance_mm2 = two[f].y_variance_mm2 = (eits_real)cases[k].variance_mm2;
            frame(two, 2);
        }
        REPORTS(cases[k].reported);
    }
}

TEST(a_pinch_that_opens_again_becomes_a_spread)
{
    begin();
    pair(50, 2, 16);
    pair(20, -2, 16);
    ENDS("2 down, 2 up, pinch begins, pinch ends, spread begins, spread ends");
    CHECK_NEAR(last(EITS_EVENT_SPREAD)->value, 100.0 / 40.0, 1e-5);
    begin();
    pair(20, -2, 16);
    pair(50, 2, 16);
    ENDS("2 down, 2 up, pinch begins, pinch ends, spread begins, spread ends");
}

/* Two fingers around the middle, by so much a frame. */
static void turn(double by, int frames)
{
    begin();
    for (int k = 0; k < frames; ++k) {
        const double x = 30 * cos(3.0 + by * k), y = 30 * sin(3.0 + by * k);
        const eits_touch two[] = {touch(1, x, y), touch(2, -x, -y)};
        frame(two, 2);
    }
}

TEST(two_fingers_turn_either_way)
{
    for (int way = -1; way <= 1; way += 2) {
        turn(way * 0.08, 40);
        ENDS("2 down, 2 up, rotate begins, rotate ends");
        CHECK(count_of(EITS_EVENT_ROTATE, EITS_PHASE_CHANGE) > 5);
        CHECK_NEAR(last(EITS_EVENT_ROTATE)->value, way * 0.08 * 38 * 57.29578, 0.05);
    }
}

/* A change is reported for each so much of way, not for each frame: 0.6 mm here, of 72. */
TEST(a_slow_turn_is_reported_by_its_way)
{
    turn(0.01, 120);
    CHECK(count_of(EITS_EVENT_ROTATE, EITS_PHASE_CHANGE) > 8);
    CHECK(count_of(EITS_EVENT_ROTATE, EITS_PHASE_CHANGE) < 80);
}

TEST(fingers_that_rest_or_are_three_do_nothing_together)
{
    begin();
    pair(50, 0, 40);
    ENDS("2 down, 2 up");
    begin();
    for (int k = 0; k < 20; ++k) {
        const eits_touch three[] = {touch(1, -50 + 2 * k, 0), touch(2, 50 - 2 * k, 0),
                                    touch(3, 0, 70)};
        frame(three, 3);
    }
    ENDS("3 down, 3 up");
}

/* ---- real frames ---- */

/* A touch of another strength or one that is held by the tracker (explained 0). */
static eits_touch faint(uint32_t id, double x, double y, double strength, double explained)
{
    eits_touch t = touch(id, x, y);
    t.strength_s_per_m_mm2 = (eits_real)strength;
    t.explained = (eits_real)explained;
    return t;
}

TEST(a_scan_that_a_finger_lands_in_invents_nothing)
{
    begin();
    const eits_touch two[] = {touch(1, -8, 3), touch(2, -37, -9)};
    frame(two, 2);
    finger(2, -30, -4, 0, 0, 6);
    ENDS("down, up, tap");
    CHECK_NEAR(last(EITS_EVENT_TAP)->x_mm, -30, 1e-6);
}

TEST(a_scan_that_a_finger_lifts_in_does_not_move_it)
{
    const eits_touch going = faint(1, 28, 50, 1.8, 0.9), held = faint(1, 28, 50, 1.8, 0);
    begin();
    finger(1, 40, 59, 0, 0, 12);
    frame(&going, 1);
    CHECK_EQUAL(b.moves, 0);
    ENDS("down, up, tap");
    CHECK_NEAR(last(EITS_EVENT_UP)->x_mm, 40, 1e-6);
    begin();
    finger(1, 40, 59, 0, 0, 6);
    frame(&going, 1);
    frame(&held, 1); /* it has lifted */
    REPORTS("down, up, tap");
    ENDS("down, up, tap");
}

TEST(a_lighter_press_is_followed_on)
{
    begin();
    finger(1, 0, 0, 0, 0, 4);
    for (int k = 0; k < 12; ++k) {
        const eits_touch light = faint(1, 4 * k, 0, 1.5, 0.9);
        frame(&light, 1);
    }
    CHECK(b.moves > 4);
    ENDS("down, up, swipe");
}

TEST(a_held_touch_and_a_lost_frame_do_not_end_a_hold)
{
    const eits_touch held = faint(1, 9, 9, 3, 0);
    begin();
    finger(1, 5, 5, 0, 0, 8);
    frame(&held, 1);
    REPORTS("down");
    CHECK_EQUAL(b.moves, 0); /* while the tracker holds the touch, its place is not known */
    finger(1, 5, 5, 0, 0, 7);
    none(1); /* more than a tap was: nothing is reported of the false lift but up */
    finger(1, 5, 5, 0, 0, 12);
    REPORTS("2 down, up, hold");
    CHECK_EQUAL(b.reported[b.count - 1].first_id, 1);
    ENDS("2 down, 2 up, hold");
}

/* A frame of which noise took a part, then one that was not solved: drives show the finger. */
TEST(a_finger_that_only_drives_show_stays_down)
{
    const eits_touch noisy = faint(1, 5, 5, 3, 0.6), driven = faint(1, 9, 5, 3, 0),
                     fading = faint(1, 8, 5, 1, 0);
    begin();
    finger(1, 5, 5, 0, 0, 4);
    for (int k = 0; k < 3; ++k) {
        frame(&noisy, 1);
        frame(&driven, 1);
    }
    REPORTS("down");
    CHECK_EQUAL(b.moves, 0);
    frame(&noisy, 1);
    frame(&fading, 1); /* and now it lifts */
    REPORTS("down, up, tap");
}

/* Single frames lack a light finger in noise; how uncertain its place is tells so. */
TEST(an_uncertain_finger_has_time_to_come_back)
{
    static const struct {
        double variance_mm2;
        int missed;
        const char *reported;
    } cases[] = {
        {1, 1, "2 down, up, tap"}, {3, 1, "down"}, {3, 2, "down"}, {3, 3, "2 down, up, tap"}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        eits_touch t = touch(1, 5, 5);
        t.x_variance_mm2 = t.y_variance_mm2 = (eits_real)cases[k].variance_mm2;
        begin();
        for (int n = 0; n < 8; ++n)
            frame(&t, 1);
        none(cases[k].missed);
        for (int n = 0; n < 8; ++n)
            frame(&t, 1);
        REPORTS(cases[k].reported);
    }
}

TEST(a_tap_that_is_found_again_is_reported_once)
{
    begin();
    finger(1, 5, 5, 0, 0, 4);
    none(1);
    finger(1, 5, 5, 0, 0, 4);
    ENDS("2 down, 2 up, tap");
    begin(); /* and so is a swipe whose tail the tracker calls by another id */
    finger(1, 0, 0, 8, 0, 8);
    none(1);
    finger(2, 72, 0, 8, 0, 3);
    ENDS("2 down, 2 up, swipe");
}

TEST(another_id_is_the_same_finger)
{
    begin();
    finger(1, 0, 0, 6, 0, 5);
    finger(9, 30, 0, 6, 0, 5);
    ENDS("down, up, swipe");
    CHECK_EQUAL(last(EITS_EVENT_SWIPE)->first_id, 1);
    begin(); /* both ids in one frame */
    finger(1, 0, 0, 6, 0, 5);
    const eits_touch both[] = {touch(1, 24, 0), touch(9, 36, 0)};
    frame(both, 2);
    finger(9, 42, 0, 6, 0, 4);
    ENDS("down, up, swipe");
    begin(); /* two frames later, at its end */
    finger(1, -12, 0, 6, 0, 7);
    frame(both, 2);
    finger(9, 42, 0, 0, 0, 1);
    ENDS("down, up, swipe");
}

TEST(half_of_a_touch_is_no_finger_until_it_has_lasted)
{
    begin();
    finger(1, 0, 0, 0, 0, 6);
    const eits_touch split[] = {touch(1, -6, 0), touch(2, 8, 0)};
    frame(split, 2);
    frame(split, 2);
    finger(1, 0, 0, 0, 0, 2);
    REPORTS("down");
    ENDS("down, up, tap");
    begin();
    finger(1, 0, 0, 0, 0, 6);
    /* a ghost of the strong one */
    const eits_touch two[] = {touch(1, 0, 0), faint(2, 60, 0, 0.1, 0.9)};
    for (int k = 0; k < 4; ++k) {
        frame(two, 2);
        if (k % 2)
            REPORTS(k == 1 ? "down" : "2 down");
    }
    ENDS("2 down, 2 up");
}

/* The tracker calls what it lands as by another id, a while later. */
TEST(a_landing_that_is_renamed_holds_where_it_rests)
{
    const eits_touch both[] = {touch(1, 14, 62), touch(2, 12, 44)};
    static const struct {
        double still_mm, dx; /* how still it is counts from there on; 0: as usual */
        const char *reported;
    } cases[] = {{0, 0, "down, hold"}, {0.5, 0, "down, hold"}, {0.5, 0.1, "down"}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        begin();
        if (cases[k].still_mm > 0)
            b.g.options.still_mm = (eits_real)cases[k].still_mm;
        finger(1, 20, 57, 0, 0, 1);
        frame(both, 2);
        finger(2, 11, 51, cases[k].dx, 0, 30);
        REPORTS(cases[k].reported);
        if (k == 0)
            CHECK_NEAR(last(EITS_EVENT_HOLD)->x_mm, 11, 1e-6);
    }
    begin(); /* of two fingers one: they begin where it is then */
    for (int k = 0; k < 12; ++k) {
        const eits_touch two[] = {touch(k < 4 ? 2 : 3, 60, 0), touch(1, k < 4 ? 15 : 0, 0)};
        const eits_touch three[] = {touch(3, 55, 10), touch(2, 65, 0), touch(1, 15, 0)};
        frame(k == 3 ? three : two, k == 3 ? 3 : 2);
    }
    ENDS("2 down, 2 up");
}

TEST(a_swipe_of_two_frames_counts_those_it_lands_and_lifts_in)
{
    begin();
    finger(1, 0, 0, 10, 0, 2);
    const eits_touch going = faint(1, 32, 0, 2, 0.9), strong = faint(1, 0, 0, 2, 0.9),
                     weak = faint(1, 0, 0, 1, 0.9), far = faint(1, 60, 0, 1, 0.9);
    frame(&going, 1);
    ENDS("down, up, swipe");
    CHECK_NEAR(last(EITS_EVENT_SWIPE)->value, 32, 1e-5);
    begin(); /* not believed: it lets go of at once what it landed at */
    finger(1, 0, 0, 0, 0, 1);
    frame(&strong, 1);
    frame(&weak, 1);
    ENDS("down, up, tap");
    begin();
    finger(1, 0, 0, 0, 0, 1);
    frame(&far, 1);
    ENDS("down, up, swipe");
}

TEST(fingers_that_merge_end_their_pinch)
{
    begin();
    pair(50, 2, 20);
    finger(1, 0, 0, 0, 0, 10);
    ENDS("2 down, 2 up, pinch begins, pinch ends");
}

TEST(a_pair_that_is_not_found_for_a_frame_goes_on)
{
    begin();
    b.g.options.lost_us = 30000;
    pair(50, 2, 12);
    finger(1, -26, 0, 0, 0, 1);
    pair(24, 1, 8);
    ENDS("2 down, 2 up, pinch begins, pinch ends");
}

/* ---- limits and hostile numbers ---- */

/* As many touches as may be, of ids and places that no other round has: for two frames. */
static void crowd(uint32_t round)
{
    eits_touch many[EITS_MAX_TOUCHES];
    for (uint32_t k = 0; k < EITS_MAX_TOUCHES; ++k)
        many[k] = touch(100 * round + k + 1, 1000.0 * round + 60.0 * k, 0);
    frame(many, EITS_MAX_TOUCHES);
    frame(many, EITS_MAX_TOUCHES);
}

TEST(events_without_room_are_counted)
{
    eits_event few[2];
    uint32_t reported;
    eits_touch many[EITS_MAX_TOUCHES];
    begin();
    for (uint32_t k = 0; k < EITS_MAX_TOUCHES; ++k)
        many[k] = touch(k + 1, 60.0 * (k % 4), 60.0 * (k / 4));
    frame(many, EITS_MAX_TOUCHES);
    CHECK_OK(eits_gestures_update(&b.g, many, EITS_MAX_TOUCHES, b.now_us, few, 2, &reported));
    CHECK_EQUAL(reported, 2);
    CHECK_EQUAL(few[1].kind, EITS_EVENT_DOWN);
    CHECK_EQUAL(b.g.dropped, EITS_MAX_TOUCHES - 2);
    CHECK_OK(eits_gestures_update(&b.g, NULL, 0, b.now_us + FRAME_US, NULL, 0, &reported));
    CHECK_EQUAL(reported, 0);
    CHECK_EQUAL(b.g.dropped, 2 * EITS_MAX_TOUCHES - 2);
}

TEST(more_fingers_than_can_be_followed_are_counted)
{
    begin();
    b.g.options.lost_us = 500000;
    for (uint32_t round = 0; round < 3; ++round) /* each time others, the old ones waited for */
        crowd(round);
    CHECK_EQUAL(b.g.dropped, 2 * EITS_MAX_TOUCHES);
    CHECK_EQUAL(count_of(EITS_EVENT_DOWN, EITS_PHASE_ONCE), EITS_MAX_CONTACTS);
    none(60); /* and all lift in one frame */
    CHECK_EQUAL(count_of(EITS_EVENT_UP, EITS_PHASE_ONCE), EITS_MAX_CONTACTS);
    CHECK_EQUAL(b.g.dropped, 2 * EITS_MAX_TOUCHES);
}

TEST(the_place_of_what_lifted_first_is_taken)
{
    begin();
    b.g.options.rejoin_us = 500000;
    for (uint32_t round = 0; round < 4; ++round) {
        crowd(round);
        none(1);
    }
    CHECK_EQUAL(b.g.dropped, 0);
    CHECK_EQUAL(count_of(EITS_EVENT_UP, EITS_PHASE_ONCE), 4 * EITS_MAX_TOUCHES);
}

TEST(what_is_no_number_is_passed_over)
{
    begin();
    for (int k = 0; k < 6; ++k) {
        eits_touch bad[] = {touch(1, NAN, 0),   touch(2, 0, INFINITY), touch(3, 1e30, 0),
                            touch(4, 0, -1e30), touch(5, 0, 0),        touch(6, 20, 20)};
        bad[4].strength_s_per_m_mm2 = (eits_real)NAN;
        bad[5].explained = (eits_real)NAN;
        frame(bad, 6);
    }
    ENDS("");
    begin();
    for (int k = 0; k < 30; ++k) { /* fingers at one place, and at the ends of the world */
        const eits_touch odd[] = {touch(1, k % 2 ? 1e6 : -1e6, 1e6), touch(1, 0, 0),
                                  touch(0, 0, 0)};
        frame(odd, (uint32_t)(k % 4));
    }
    begin();
    pair(50, 5, 11); /* to one place */
    pair(0, -5, 11);
    ENDS("2 down, 2 up, pinch begins, pinch ends, spread begins, spread ends");
}

TEST(time_that_stands_goes_back_or_leaps)
{
    begin();
    finger(1, 0, 0, 0, 0, 4);
    b.now_us -= FRAME_US; /* the same frame again */
    finger(1, 50, 0, 0, 0, 1);
    CHECK_EQUAL(b.moves, 0);
    b.now_us -= 100 * FRAME_US;
    none(1);
    REPORTS("down, up");
    pair(50, 2, 20);
    b.now_us += 2000000;
    none(1);
    REPORTS("3 down, 3 up, pinch begins, pinch ends"); /* the pinch had begun */
}

TEST(wrong_arguments_are_refused)
{
    eits_event events[1];
    eits_gesture_options options;
    uint32_t reported;
    const eits_touch t = touch(1, 0, 0);
    begin();
    CHECK_REFUSED(eits_gestures_default(NULL));
    CHECK_REFUSED(eits_gestures_init(NULL, NULL));
    CHECK_OK(eits_gestures_default(&options));
    CHECK_OK(eits_gestures_init(&b.g, &options));
    options.split_mm = (eits_real)NAN;
    CHECK_REFUSED(eits_gestures_init(&b.g, &options));
    options.split_mm = -1;
    CHECK_REFUSED(eits_gestures_init(&b.g, &options));
    CHECK_REFUSED(eits_gestures_update(NULL, &t, 1, 0, events, 1, &reported));
    CHECK_REFUSED(eits_gestures_update(&b.g, NULL, 1, 0, events, 1, &reported));
    CHECK_REFUSED(eits_gestures_update(&b.g, &t, EITS_MAX_TOUCHES + 1, 0, events, 1, &reported));
    CHECK_REFUSED(eits_gestures_update(&b.g, &t, 1, 0, NULL, 1, &reported));
    CHECK_REFUSED(eits_gestures_update(&b.g, &t, 1, 0, events, 1, NULL));
}

RUN_TESTS("gesture")

/* A frame's touches of those that drives follow and those that the solver found. */
#include "check.h"

#include "eitskin/fast.h"
#include "fast/fast.h"

static eits_fast_touch followed(uint32_t id, double x_mm, double strength)
{
    return (eits_fast_touch){.id = id,
                             .x_mm = (eits_real)x_mm,
                             .strength_s_per_m_mm2 = (eits_real)strength,
                             .radius_mm = 7};
}

static eits_touch found_at(uint32_t id, double x_mm, double strength)
{
    return (eits_touch){.id = id,
                        .x_mm = (eits_real)x_mm,
                        .strength_s_per_m_mm2 = (eits_real)strength,
                        .radius_mm = 9,
                        .explained = (eits_real)0.5};
}

TEST(wrong_arguments)
{
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count;
    CHECK(eits_fast_report(NULL, 0, NULL, 0, NULL, 0, NULL, &count) == EITS_E_ARGUMENT);
    CHECK(eits_fast_report(NULL, 0, NULL, 0, NULL, 0, touches, NULL) == EITS_E_ARGUMENT);
    CHECK(eits_fast_report(NULL, EITS_FAST_TOUCHES + 1, NULL, 0, NULL, 0, touches, &count) ==
          EITS_E_ARGUMENT);
    CHECK(eits_fast_report(NULL, 0, NULL, EITS_MAX_TOUCHES + 1, NULL, 0, touches, &count) ==
          EITS_E_ARGUMENT);
    CHECK(eits_fast_report(NULL, 0, NULL, 0, NULL, EITS_MAX_TOUCHES + 1, touches, &count) ==
          EITS_E_ARGUMENT);
    CHECK(eits_fast_report(NULL, 0, NULL, 0, NULL, 0, touches, &count) == EITS_OK && count == 0);
}

/* The nearer touch that was found gives its place and shape, the one followed its id; what is not
 * found is reported as followed. The strongest comes first. */
TEST(a_followed_touch_is_what_was_found_near_it)
{
    const eits_fast_touch tracked[] = {followed(3, 0, 1), followed(4, 50, 2)};
    const eits_touch found[] = {found_at(1, 5, 4), found_at(2, 1, 3)};
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count;
    CHECK(eits_fast_report(tracked, 2, found, 2, NULL, 0, touches, &count) == EITS_OK);
    CHECK(count == 2);
    CHECK(touches[0].id == 3 && touches[0].x_mm == 1 && touches[0].radius_mm == 9);
    CHECK(touches[0].confirmed == 1);
    CHECK(touches[1].id == 4 && touches[1].x_mm == 50 && touches[1].radius_mm == 7);
    CHECK(touches[1].confirmed == 0 && touches[1].explained == 0);
}

/* A touch that drives do not follow counts from its second frame on, once for each touch before. */
TEST(a_touch_of_frames_alone_was_there_before)
{
    const eits_touch found[] = {found_at(1, -40, 5), found_at(2, -42, 4)};
    const eits_touch before[] = {found_at(7, -41, 5)};
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count;
    CHECK(eits_fast_report(NULL, 0, found, 2, NULL, 0, touches, &count) == EITS_OK && count == 0);
    CHECK(eits_fast_report(NULL, 0, found, 2, before, 1, touches, &count) == EITS_OK);
    CHECK(count == 1);
    CHECK(touches[0].id == EITS_FAST_FRAME_IDS + 1 && touches[0].confirmed == 1);
}

RUN_TESTS("fast_report")

/* The fast path, with drives that a formula of the test makes: touches that land, move, change and
 * lift; faulty rows; frames beside the drives; refused calls. */
#include "steps.h"

#include "base/half.h"
#include "fast/fast.h"

enum { DRIVE_US = 1300, MAX_FINGERS = 7, SIDE = 24 };
#define NOISE 2e-5

typedef struct finger {
    double x_mm, y_mm, strength;
} finger;

typedef struct bench {
    small_model small;
    small_context skin;
    void *memory;
    size_t size;
    void *aligned;
    eits_fast *fast;
    eits_real untouched[SMALL_ROWS], frame[SMALL_ROWS];
    double sigma, gain_drift; /* V; of all voltages */
    uint32_t now_us, next;
    uint64_t random;
    finger on[MAX_FINGERS];
    uint32_t fingers;
} bench;

static void tare(bench *b, eits_sign sign)
{
    CHANGE_OPTIONS(b->skin.ctx, o.sign = sign);
    small_reference(&b->skin.model, 1.0, b->untouched);
    double square = 0;
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        square += (double)b->untouched[i] * (double)b->untouched[i];
    b->sigma = NOISE * sqrt(square / SMALL_ROWS);
    eits_real frames[16][SMALL_ROWS];
    for (uint32_t i = 0; i < 16 * SMALL_ROWS; ++i)
        frames[i / SMALL_ROWS][i % SMALL_ROWS] =
            (eits_real)((double)b->untouched[i % SMALL_ROWS] +
                        b->sigma * 2 * small_random(&b->random));
    LEARN(b->skin.ctx, 16, frames);
    memcpy(b->frame, frames[15], sizeof b->frame);
}

static bench *bench_open(eits_sign sign)
{
    static bench kept;
    bench *b = &kept;
    small_context_close(&b->skin);
    small_model_free(&b->small);
    free(b->memory);
    memset(b, 0, sizeof *b);
    if (sign == EITS_SIGN_BOTH) /* none any more */
        return NULL;
    b->random = 3;
    b->small = small_model_make(
        (small_spec){.rank = 12, .side = SIDE, .round = 1, .shape = SMALL_WHITENED, .fields = 1});
    small_context_open(&b->skin, &b->small, 0);
    tare(b, sign);
    b->size = eits_fast_size(&b->skin.model);
    b->aligned = small_aligned(&b->memory, b->size);
    CHECK_OK(eits_fast_init(b->aligned, b->size, b->skin.ctx, &b->fast));
    CHECK_OK(eits_fast_begin(b->fast));
    return b;
}

static double field(const bench *b, uint32_t pixel, uint32_t plus, uint32_t minus, int y)
{
    const uint16_t *column =
        (const uint16_t *)b->skin.model.fields.at.data + (size_t)pixel * SMALL_FIELDS_STRIDE;
    const uint32_t from = y ? SMALL_ELECTRODES : 0;
    return (double)eits_half_to_float(column[from + plus]) -
           (double)eits_half_to_float(column[from + minus]);
}

/* The change of a row by a finger, in V, by the definition: a mean of E_drive . E_measure. */
static double answer(const bench *b, uint32_t i, finger at)
{
    const eits_model *m = &b->skin.model;
    const uint8_t *row = m->protocol + 4 * (size_t)i;
    const double rho = 1.2 * (double)m->defaults->touch_seed_radius_mm;
    double sum = 0, weights = 0;
    for (uint32_t j = 0; j < m->n_pixels; ++j) {
        const double dx =
            (double)m->origin_x_mm + (m->pixel[j].ix + 0.5) * (double)m->pixel_mm - at.x_mm;
        const double dy =
            (double)m->origin_y_mm + (m->pixel[j].iy + 0.5) * (double)m->pixel_mm - at.y_mm;
        const double left = 1 - (dx * dx + dy * dy) / (rho * rho);
        const double weight = left > 0 ? left * left : 0;
        weights += weight;
        sum += weight * (field(b, j, row[0], row[1], 0) * field(b, j, row[2], row[3], 0) +
                         field(b, j, row[0], row[1], 1) * field(b, j, row[2], row[3], 1));
    }
    const double gain =
        (double)b->skin.ctx->reference.gain * (double)b->skin.ctx->reference.row_gain[i];
    return -(double)m->fields.volts * at.strength * sum / weights / gain;
}

/* Strengths are in units that give rows of some hundred times the noise. */
static double unit(const bench *b)
{
    double square = 0;
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        square += pow(answer(b, i, (finger){0, 0, 1}), 2);
    return 300 * b->sigma / sqrt(square / SMALL_ROWS);
}

static void put(bench *b, uint32_t n, double x_mm, double y_mm, double strength)
{
    b->on[n] = (finger){x_mm, y_mm, strength * unit(b)};
    b->fingers = b->fingers > n ? b->fingers : n + 1;
}

/* The next drive's rows as the fingers are now, into the frame. */
static void measure(bench *b)
{
    uint32_t count = 0;
    const uint16_t *rows = eits_fast_rows(b->fast, b->next, &count);
    for (uint32_t i = 0; i < count; ++i) {
        double v = (double)b->untouched[rows[i]] * (1 + b->gain_drift);
        for (uint32_t k = 0; k < b->fingers; ++k)
            v += answer(b, rows[i], b->on[k]);
        b->frame[rows[i]] = (eits_real)(v + b->sigma * 2 * small_random(&b->random));
    }
}

/* Gives the frame's rows of the next drive. */
static void give(bench *b)
{
    eits_real volts[EITS_FAST_ROWS];
    uint32_t count = 0;
    const uint16_t *rows = eits_fast_rows(b->fast, b->next, &count);
    for (uint32_t i = 0; i < count; ++i)
        volts[i] = b->frame[rows[i]];
    b->now_us += DRIVE_US;
    CHECK_OK(eits_fast_drive(b->fast, b->next, volts, count, b->now_us));
    CHECK(b->fast->held_count <= b->fast->ring_count && b->fast->ring_count <= EITS_FAST_RING);
    b->next = (b->next + 3) % eits_fast_drives(b->fast);
}

static void drives(bench *b, uint32_t count)
{
    for (; count > 0; --count) {
        measure(b);
        give(b);
    }
}

static uint32_t reported(const bench *b, eits_fast_touch *touches)
{
    uint32_t count = 99;
    CHECK_OK(eits_fast_touches(b->fast, touches, EITS_FAST_TOUCHES, &count));
    for (uint32_t k = 0; k < count && count <= EITS_FAST_TOUCHES; ++k)
        CHECK(eits_is_finite(touches[k].x_mm) && eits_is_finite(touches[k].y_mm) &&
              eits_is_finite(touches[k].vx_mm_per_s) && eits_is_finite(touches[k].vy_mm_per_s) &&
              eits_is_finite(touches[k].strength_s_per_m_mm2));
    return count;
}

/* Each finger is reported once, within `near_mm`, and nothing else. */
static void check_reported(const bench *b, double near_mm)
{
    eits_fast_touch touches[EITS_FAST_TOUCHES];
    const uint32_t count = reported(b, touches);
    CHECK_EQUAL(count, b->fingers);
    for (uint32_t n = 0; n < b->fingers; ++n) {
        double least = 1e9;
        for (uint32_t k = 0; k < count; ++k) {
            const double off = hypot((double)touches[k].x_mm - b->on[n].x_mm,
                                     (double)touches[k].y_mm - b->on[n].y_mm);
            least = off < least ? off : least;
        }
        CHECK_NEAR(least, 0, near_mm);
    }
}

static uint32_t align(bench *b, eits_real *aligned)
{
    uint32_t state = 99;
    CHECK_OK(eits_fast_align(b->fast, b->frame, SMALL_ROWS, aligned, &state));
    return state;
}

/* Gives the fast path the touches that were found in the last aligned frame. */
static void find(bench *b, const double (*places)[2], uint32_t count)
{
    eits_touch found[EITS_MAX_TOUCHES];
    memset(found, 0, sizeof found);
    for (uint32_t k = 0; k < count; ++k) {
        found[k].x_mm = (eits_real)places[k][0];
        found[k].y_mm = (eits_real)places[k][1];
        found[k].strength_s_per_m_mm2 = (eits_real)unit(b);
    }
    CHECK_OK(eits_fast_confirm(b->fast, found, count));
}

static void confirm(bench *b, const double (*places)[2], uint32_t count)
{
    (void)align(b, (eits_real[SMALL_ROWS]){0});
    find(b, places, count);
}

static void confirm_twice(bench *b, const double (*places)[2], uint32_t count)
{
    confirm(b, places, count);
    confirm(b, places, count);
}

/* So many drives, and a frame of them. */
static void settle(bench *b, uint32_t count)
{
    drives(b, count);
    (void)align(b, (eits_real[SMALL_ROWS]){0});
}

TEST(test_nothing_touches)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_real aligned[SMALL_ROWS];
    for (uint32_t k = 0; k < 40; ++k) {
        drives(b, 8);
        CHECK_EQUAL(align(b, aligned), EITS_FAST_EXPLAINED | EITS_FAST_TRUSTED);
        CHECK(memcmp(aligned, b->frame, sizeof aligned) == 0);
        confirm(b, NULL, 0);
    }
    check_reported(b, 0);
}

static void follow_a_finger(eits_sign sign)
{
    bench *b = bench_open(sign);
    const double way = sign == EITS_SIGN_DECREASE ? -1 : 1;
    eits_fast_touch touch[EITS_FAST_TOUCHES];
    eits_real aligned[SMALL_ROWS];
    b->now_us = 0xFFFFFF00u; /* the clock wraps */
    drives(b, 16);
    put(b, 0, 20, 11, way);
    drives(b, 6);
    check_reported(b, 1.0);
    (void)reported(b, touch);
    const uint32_t id = touch[0].id;
    CHECK(id == 1 && !touch[0].confirmed && (double)touch[0].strength_s_per_m_mm2 * way > 0);
    /* a frame with a drive that nothing explains, its first, stays as it was measured */
    CHECK_EQUAL(align(b, aligned), 0);
    CHECK(memcmp(aligned, b->frame, sizeof aligned) == 0);
    drives(b, 8);
    CHECK(align(b, aligned) & EITS_FAST_TRUSTED);
    confirm(b, (const double[][2]){{21, 10}}, 1);
    drives(b, 24);
    (void)reported(b, touch);
    CHECK_EQUAL(touch[0].confirmed, 1);
    check_reported(b, 0.2);
    CHECK_EQUAL(align(b, aligned), EITS_FAST_EXPLAINED | EITS_FAST_TRUSTED);
    CHECK(memcmp(aligned, b->frame, sizeof aligned) == 0);
    for (uint32_t k = 0; k < 60; ++k) { /* 300 mm/s */
        b->on[0].x_mm -= 0.39;
        drives(b, 1);
    }
    check_reported(b, 1.5);
    (void)reported(b, touch);
    CHECK_EQUAL(touch[0].id, id);
    CHECK_NEAR(touch[0].vx_mm_per_s, -300, 60);
    CHECK(align(b, aligned) & EITS_FAST_TRUSTED);
    CHECK(memcmp(aligned, b->frame, sizeof aligned) != 0);
    b->fingers = 0;
    drives(b, 4);
    CHECK_EQUAL(reported(b, touch), 0);
    /* on again before it is forgotten, where it was */
    put(b, 0, (double)b->fast->state[FAST_X], (double)b->fast->state[FAST_Y], way);
    drives(b, 10);
    check_reported(b, 1.0);
    CHECK_EQUAL(b->fast->count, 1);
    b->fingers = 0;
    drives(b, 4 * EITS_FAST_GONE); /* until it is sure that it has left nothing */
    CHECK_EQUAL(b->fast->count, 0);
}

TEST(test_a_finger)
{
    follow_a_finger(EITS_SIGN_INCREASE);
    follow_a_finger(EITS_SIGN_DECREASE);
}

/* Strengths of any size: where the model's volts are 2^-40 as many, a touch is 2^40 times as strong
 * and in all else the same, to the last bit. */
TEST(test_any_unit_of_strength)
{
    eits_fast_touch touch[2][EITS_FAST_TOUCHES];
    for (uint32_t k = 0; k < 2; ++k) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        b->skin.model.fields.volts *= k == 0 ? 1.0f : 0x1p-40f;
        b->skin.model.fields.per_sheet *= k == 0 ? 1.0f : 0x1p-40f;
        CHECK_OK(eits_fast_init(b->aligned, b->size, b->skin.ctx, &b->fast));
        CHECK_OK(eits_fast_begin(b->fast));
        drives(b, 8);
        put(b, 0, 22, 38, 2);
        drives(b, 24);
        put(b, 1, -40, -24, 3);
        drives(b, 24);
        check_reported(b, 1.0);
        (void)reported(b, touch[k]);
    }
    for (uint32_t n = 0; n < 2; ++n) {
        CHECK(touch[0][n].x_mm == touch[1][n].x_mm && touch[0][n].y_mm == touch[1][n].y_mm);
        CHECK(touch[0][n].strength_s_per_m_mm2 * R(0x1p40) == touch[1][n].strength_s_per_m_mm2);
    }
}

/* No pair is reported if one of its touches is at the place of a known touch, even if the known
 * touch explains nothing. */
TEST(test_two_at_once)
{
    for (uint32_t known = 0; known < 3; ++known) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        drives(b, 8);
        put(b, 0, 22, 38, 3);
        put(b, 1, -40, -24, 3);
        if (known < 2) {
            b->fast->count = 1;
            b->fast->known[0] =
                (fast_known){.id = 9, .on = 1, .energy = R(1e9), .rho2 = b->fast->rho2};
            b->fast->state[FAST_X] = (eits_real)b->on[known].x_mm;
            b->fast->state[FAST_Y] = (eits_real)b->on[known].y_mm;
        }
        drives(b, 40);
        if (known == 2)
            check_reported(b, 1.0);
        else
            CHECK(b->fast->count == 1 && b->fast->known[0].id == 9);
        b->fingers = 0; /* after a search for two */
        drives(b, 4);
    }
}

TEST(test_several_fingers)
{
    static const double places[][2] = {{22, 38}, {-40, -24}, {34, -18}, {-5, -44}, {-30, 20}};
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_fast_touch touches[EITS_FAST_TOUCHES];
    uint32_t count;
    drives(b, 8);
    for (uint32_t n = 0; n < 5; ++n)
        put(b, n, places[n][0], places[n][1], 1);
    for (b->fingers = 1; b->fingers <= 2; ++b->fingers) {
        drives(b, 24);
        check_reported(b, 1.0);
    }
    b->fingers = 5; /* the five rows of a drive show at most two touches; frames find the others */
    confirm_twice(b, places, 5);
    drives(b, 40);
    check_reported(b, 1.0);
    CHECK_OK(eits_fast_touches(b->fast, touches, 2, &count));
    CHECK_EQUAL(count, 2);
    put(b, 5, 0, 2, 1); /* so few rows may or may not show a sixth touch */
    drives(b, 40);
    CHECK(b->fast->count >= 5 && b->fast->count <= EITS_FAST_TOUCHES);
    b->fingers = 5;
    confirm(b, places + 3, 2); /* frames do not show the first three */
    confirm(b, places + 3, 2);
    CHECK_EQUAL(reported(b, touches), 2);
    memmove(b->on, b->on + 3, 2 * sizeof b->on[0]);
    b->fingers = 2;
    drives(b, 40);
    check_reported(b, 1.5); /* five rows a drive */
}

/* Rows that no touch changes: nothing is reported, and a finger is found all the same. */
static void spoil_glitch(bench *b)
{
    if (b->now_us / DRIVE_US % 11 == 0)
        b->frame[eits_fast_rows(b->fast, b->next, &(uint32_t){0})[2]] +=
            (eits_real)(500 * b->sigma);
}

static void spoil_missing(bench *b)
{
    b->frame[7] = (eits_real)NAN;
    b->frame[13] = (eits_real)INFINITY;
    b->frame[23] = (eits_real)1e30;
}

static void spoil_dead(bench *b)
{
    for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
        if (b->skin.model.protocol[4 * i + 2] == 3)
            b->frame[i] = 0;
    }
}

/* Measured with electrode 3, which floats: suspect at once, and no frame is believed meanwhile. */
static void spoil_open(bench *b)
{
    for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
        const uint8_t *row = b->skin.model.protocol + 4 * i;
        if (row[2] == 3 || row[3] == 3)
            b->frame[i] = (eits_real)(i % 2 == 0 ? 5.0 : -1.0) * b->untouched[i];
    }
    if (b->next == 0 && b->fast->wild > 0) {
        confirm(b, (const double[][2]){{-40, 0}}, 1);
        CHECK(b->fast->seeds == 0 && b->fast->wild == 0);
    }
}

static void spoil_drift(bench *b)
{
    b->gain_drift = fmin(b->gain_drift + 2e-6, 4e-4);
}

TEST(test_other_things_than_touches)
{
    void (*const spoils[])(bench *) = {spoil_glitch, spoil_missing, spoil_dead, spoil_open,
                                       spoil_drift};
    for (size_t how = 0; IN_TABLE(how, spoils); ++how) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        for (uint32_t k = 0; k < 264; ++k) {
            if (k == 200) {
                check_reported(b, 0);
                put(b, 0, 12, -20, 1);
            }
            measure(b);
            spoils[how](b);
            give(b);
        }
        check_reported(b, 1.0);
        CHECK_EQUAL(b->fast->suspect[3] > EITS_FAST_SUSPECT,
                    spoils[how] == spoil_open || spoils[how] == spoil_dead);
    }
}

/* Rows that are missing are not rows that a finger leaves as they were: wherever it lands, it is
 * reported after a few drives. */
TEST(test_fingers_beside_missing_rows)
{
    for (uint32_t place = 0; place < 16; ++place) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        drives(b, 16);
        put(b, 0, 36 * cos(0.4 * place), 36 * sin(0.4 * place), 0.3);
        for (uint32_t k = 0; k < 10; ++k) {
            measure(b);
            for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
                const uint8_t *row = b->skin.model.protocol + 4 * (size_t)i;
                if (memchr(row + 2, 1, 2) != NULL || memchr(row + 2, 3, 2) != NULL)
                    b->frame[i] = (eits_real)NAN;
            }
            give(b);
        }
        check_reported(b, 2.0);
    }
}

/* Noise that no touch explains: little is reported, none for long, and nothing breaks. */
TEST(test_rows_without_sense)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_fast_touch touches[EITS_FAST_TOUCHES];
    uint32_t drives_reported = 0;
    for (uint32_t k = 0; k < 400; ++k) {
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b->frame[i] =
                (eits_real)((double)b->untouched[i] * (1 + 1e-2 * small_random(&b->random)));
        give(b);
        drives_reported += reported(b, touches) > 0;
    }
    CHECK(drives_reported < 20);
    CHECK_EQUAL(align(b, b->frame), EITS_FAST_TRUSTED * 0);
    CHECK_EQUAL(align(b, b->frame), EITS_FAST_TRUSTED);
}

TEST(test_frames_begin_and_end_touches)
{
    static const double far[][2] = {{-40, 0}, {40, 0},  {0, 40},  {0, -40},
                                    {0, 0},   {28, 28}, {-28, 28}};
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_fast_touch touches[EITS_FAST_TOUCHES];
    confirm(b, far, 1);
    CHECK_EQUAL(reported(b, touches), 0); /* one frame is not enough */
    confirm(b, far, 1);
    CHECK_EQUAL(reported(b, touches), 1);
    CHECK_EQUAL(touches[0].confirmed, 1);
    CHECK_NEAR(touches[0].x_mm, -40, 1e-4);
    confirm(b, (const double[][2]){{-40, 4}, {-40, -4}}, 2); /* one of them is beside it */
    confirm(b, (const double[][2]){{-40, 4}, {-40, -4}}, 2);
    CHECK_EQUAL(reported(b, touches), 1);
    confirm(b, far, 7); /* more than there is room for */
    confirm(b, far, 7);
    CHECK_EQUAL(reported(b, touches), EITS_FAST_TOUCHES);
    confirm(b, far, 0);
    CHECK_EQUAL(reported(b, touches), EITS_FAST_TOUCHES); /* one frame does not end them */
    confirm(b, far, 0);
    CHECK_EQUAL(reported(b, touches), 0);
    confirm_twice(b, far, 1);
    eits_real aligned[SMALL_ROWS];
    put(b, 0, -40, 0, 1);
    drives(b, 4);
    (void)align(b, aligned); /* the frames had it in all drives: it is not added to the others */
    CHECK(memcmp(aligned, b->frame, sizeof aligned) == 0);
    b->fingers = 0;
    drives(b, 24 + EITS_FAST_GONE); /* rows do not bear it out */
    CHECK_EQUAL(reported(b, touches), 0);
}

/* A frame that is solved although its drives are not explained. */
static void settle_unexplained(bench *b)
{
    for (uint32_t n = 0; n <= EITS_FAST_FRAMES; ++n)
        settle(b, 2);
    CHECK(b->fast->unexplained_frames > EITS_FAST_FRAMES);
}

/* Drives have not found three fingers that land at once beside a known one. A frame whose touches
 * explain all of it shows them at once, and corrects the known one; any other frame does not. */
TEST(test_one_frame_decides)
{
    static const double all[][2] = {{20, 15}, {-30, 5}, {-5, -35}, {0, 40}};
    const struct {
        double left;
        uint32_t diagnostics, touches;
    } cases[] = {{0.0005, 0, 4},
                 {0.0005, EITS_DIAGNOSTIC_CROWDED, 4},
                 {0.0005, EITS_DIAGNOSTIC_OUTLIER, 1},
                 {0.01, 0, 1}};
    for (uint32_t n = 0; n < sizeof cases / sizeof cases[0]; ++n) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        eits_fast_touch touches[EITS_FAST_TOUCHES];
        drives(b, 8);
        put(b, 0, 20, 11, 1);
        settle(b, 32);
        for (uint32_t k = 1; k < 4; ++k)
            put(b, k, all[k][0], all[k][1], 1);
        settle_unexplained(b);
        CHECK_EQUAL(reported(b, touches), 1);
        b->skin.ctx->info.unexplained = (eits_real)cases[n].left;
        b->skin.ctx->info.diagnostics = cases[n].diagnostics;
        find(b, all, 4);
        CHECK_EQUAL(reported(b, touches), cases[n].touches);
        CHECK_NEAR(touches[0].y_mm, cases[n].touches == 4 ? 15 : 11, 1);
    }
}

/* Drives arrive while a frame is solved. The touches of the frame are at earlier places, and the
 * frame cannot have touches that landed since. */
TEST(test_touches_that_move_on)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_fast_touch touch[EITS_FAST_TOUCHES];
    put(b, 0, 20, 11, 1);
    settle(b, 16);
    for (uint32_t k = 1; k <= 20; ++k) {
        put(b, 0, 20 - (double)k, 11, 1);
        drives(b, 1);
    }
    find(b, (const double[][2]){{20, 11}}, 1);
    CHECK_EQUAL(reported(b, touch), 1);
    CHECK_NEAR(touch[0].x_mm, 0, 2.0);
    CHECK_EQUAL(touch[0].confirmed, 1);
    CHECK_EQUAL(b->fast->seeds, 0);
    CHECK_EQUAL(b->fast->known[0].frames_missed, 0);
    find(b, NULL, 0); /* of no frame since */
    CHECK_EQUAL(b->fast->known[0].frames_missed, 0);
    confirm(b, NULL, 0);
    CHECK_EQUAL(b->fast->known[0].frames_missed, 1);
}

/* Rows of an electrode that a frame named are left out, until none is named. */
TEST(test_named_electrodes)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    uint8_t *states = b->skin.ctx->rows.electrode;
    states[3] = 1;
    confirm(b, NULL, 0);
    for (uint32_t k = 0; k < 32; ++k) {
        measure(b);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
            if (memchr(b->skin.model.protocol + 4 * i, 3, 4) != NULL)
                b->frame[i] += (eits_real)(300 * b->sigma * small_random(&b->random));
        }
        give(b);
        check_reported(b, 0);
        CHECK_EQUAL(b->fast->unexplained, 0);
    }
    states[3] = 0;
    confirm(b, NULL, 0);
    CHECK_EQUAL(b->fast->masked[0] | b->fast->masked[39], 0);
}

/* A frame whose drives leave little unexplained is solved at once: noise hides what a landing touch
 * smears in it, and drives may never find the touch. */
TEST(test_frames_of_light_touches_are_solved)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_real aligned[SMALL_ROWS];
    for (uint32_t strong = 0; strong < 2; ++strong) {
        drives(b, 8);
        CHECK_EQUAL(align(b, aligned), EITS_FAST_EXPLAINED | EITS_FAST_TRUSTED);
        drives(b, 8);
        b->fast->drive[2].explained = 0;
        b->fast->news = strong ? 2 * EITS_FAST_LITTLE_NEWS : EITS_FAST_LITTLE_NEWS / 2;
        CHECK_EQUAL(align(b, aligned), strong ? 0 : EITS_FAST_TRUSTED);
        CHECK(b->fast->news == 0);
    }
    put(b, 0, 20, 11, 1);
    drives(b, 1);
    CHECK(b->fast->news > EITS_FAST_LITTLE_NEWS);
}

/* Where a touch is off, a frame may find what the skin keeps of it, which is weak. A strong touch
 * there is a finger: noise ended the one that drives followed. */
TEST(test_a_strong_touch_where_one_is_off_is_a_finger)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_touch all[EITS_MAX_TOUCHES];
    eits_real aligned[SMALL_ROWS];
    drives(b, 8);
    put(b, 0, 20, 11, 1);
    drives(b, 40);
    for (uint32_t strong = 0; strong < 2; ++strong) {
        eits_touch found = {.x_mm = 20, .y_mm = 11, .explained = 1};
        found.strength_s_per_m_mm2 = (strong ? R(0.9) : R(0.1)) * b->fast->known[0].peak;
        uint32_t count = 9;
        for (uint32_t frame = 0; frame < 2; ++frame) {
            b->fast->known[0].on = 0;
            (void)align(b, aligned);
            CHECK_OK(eits_fast_report(b->fast, &found, 1, all, &count));
        }
        CHECK_EQUAL(count, strong);
    }
}

/* A finger that lifts leaves a part of its signal: it is not a touch, however short the finger was
 * there. A new press at the same place is another touch. */
TEST(test_what_a_finger_leaves)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    const double places[1][2] = {{20, 11}};
    eits_fast_touch touches[EITS_FAST_MAX_TOUCHES];
    drives(b, 8);
    put(b, 0, 20, 11, 1);
    drives(b, 40);
    confirm(b, places, 1);
    CHECK_EQUAL(reported(b, touches), 1);
    const uint32_t first = touches[0].id;
    put(b, 0, 20, 11, 0.2);
    drives(b, 8);
    for (uint32_t n = 0; n < 3 * EITS_FAST_GONE; ++n) {
        drives(b, 1);
        CHECK_EQUAL(reported(b, touches), 0);
    }
    put(b, 0, 20, 11, 0.6);
    drives(b, 8);
    CHECK_EQUAL(reported(b, touches), 1);
    CHECK_EQUAL(touches[0].id, first + 1);
}

/* A frame in which a touch grows by much may show it as several, which are not taken over. What is
 * left of its drives is little; else the frame would not be solved. */
TEST(test_a_touch_that_grows_stays_one)
{
    const double places[2][2] = {{20, 23}, {20, -1}};
    eits_real aligned[SMALL_ROWS];
    for (uint32_t grows = 0; grows < 2; ++grows) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        drives(b, 8);
        put(b, 0, 20, 11, 0.5);
        drives(b, 24);
        (void)align(b, aligned);
        put(b, 0, 20, 11, grows ? 1 : 0.5);
        drives(b, 7);
        b->fast->drive[2].explained = 0;
        b->fast->news = EITS_FAST_LITTLE_NEWS / 2;
        CHECK_EQUAL(align(b, aligned), EITS_FAST_TRUSTED);
        CHECK_EQUAL(b->fast->smeared, grows ? FAST_GROWS : 0);
        find(b, places, 2);
        CHECK_EQUAL(b->fast->known[0].last, grows ? FAST_NOT_SEEN : FAST_ELSEWHERE);
        CHECK_EQUAL(b->fast->seeds, grows ? 0 : 1);
    }
}

/* A frame is not solved while a drive of it waits for an explanation; but it is, as it was
 * measured, while an electrode is named. */
TEST(test_frames_of_a_named_electrode_are_solved)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    uint8_t *states = b->skin.ctx->rows.electrode;
    eits_real aligned[SMALL_ROWS];
    for (uint32_t named = 0; named < 2; ++named) {
        CHECK_OK(eits_fast_begin(b->fast));
        states[3] = (uint8_t)named;
        confirm(b, NULL, 0);
        b->fingers = 0;
        drives(b, 8);
        put(b, 0, 20, 11, 1);
        drives(b, 2); /* one of them may have no rows without the electrode */
        CHECK_EQUAL(align(b, aligned), named ? EITS_FAST_TRUSTED : 0);
        CHECK(memcmp(aligned, b->frame, sizeof aligned) == 0);
    }
    CHECK_OK(eits_fast_begin(b->fast)); /* what a frame named before is forgotten */
    drives(b, 1);
    CHECK_EQUAL(align(b, aligned) & EITS_FAST_TRUSTED, 0);
    states[3] = 0;
}

/* An error that was learned wrongly in one drive takes strength from the touch in that drive. It is
 * learned again from what the drive leaves, and does not grow from scan to scan. */
TEST(test_a_wrong_error_does_not_grow)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    drives(b, 8);
    put(b, 0, 20, 11, 1);
    drives(b, 80);
    while (b->next != 3)
        drives(b, 1);
    drives(b, 1);
    const fast_drive *d = &b->fast->drive[3];
    for (uint32_t i = d->first; i < (uint32_t)d->first + d->count; ++i)
        b->fast->bias[i] += R(0.1) * b->fast->bias_h[i];
    const double strength = (double)b->fast->state[FAST_C];
    double most = 0;
    for (uint32_t scan = 0; scan < 30; ++scan) {
        for (uint32_t n = 0; n < eits_fast_drives(b->fast); ++n) {
            drives(b, 1);
            const double off = fabs((double)b->fast->state[FAST_C] / strength - 1);
            most = off > most ? off : most;
        }
    }
    CHECK(most < 0.12);
}

/* Its place grows less sure by the same variance in each drive that does not show it, and sure
 * again as soon as one does. */
TEST(test_a_touch_that_no_row_shows)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    const eits_real each =
        EITS_FAST_STILL_MM * EITS_FAST_STILL_MM * (eits_real)DRIVE_US * R(1e-6) / EITS_FAST_DRIVE_S;
    drives(b, 8);
    put(b, 0, 20, 11, 1);
    drives(b, 40);
    check_reported(b, 0.3);
    CHECK_EQUAL(b->fast->known[0].moving, 0);
    const eits_real seen = b->fast->p[FAST_X][FAST_X];
    eits_real before = seen;
    for (uint32_t k = 0; k < 6; ++k) {
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b->frame[i] = (eits_real)NAN;
        give(b);
        CHECK_NEAR(b->fast->p[FAST_X][FAST_X] - before, each, 1e-3 * (double)each);
        before = b->fast->p[FAST_X][FAST_X];
    }
    drives(b, 8);
    CHECK(b->fast->p[FAST_X][FAST_X] < (before + seen) / 2);
    check_reported(b, 0.3);
}

/* A finger that rests does not jump, whatever would explain a few drives. A young one may. */
TEST(test_a_touch_that_rests_does_not_jump)
{
    for (uint32_t rests = 0; rests < 2; ++rests) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        eits_fast_touch touches[EITS_FAST_TOUCHES];
        drives(b, 8);
        put(b, 0, 20, 11, 1);
        drives(b, rests ? 80 : 16);
        put(b, 0, 29, 11, 1);
        drives(b, 12);
        CHECK_EQUAL(reported(b, touches), 1);
        CHECK_NEAR(touches[0].x_mm, rests ? 20 : 29, 1);
    }
}

/* The first finger may be reported by the first drive that shows it clearly; one beside a known
 * finger, which might have moved, must come out of two searches. Lifted, each goes alone. */
TEST(test_fingers_land_one_after_another_and_lift)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_fast_touch touch[EITS_FAST_TOUCHES];
    uint32_t waited[2] = {0, 0};
    drives(b, 8);
    for (uint32_t n = 0; n < 2; ++n) {
        put(b, n, n == 0 ? 22 : -40, n == 0 ? 38 : -24, 2);
        while (reported(b, touch) <= n && waited[n] < 12) {
            drives(b, 1);
            ++waited[n];
        }
        CHECK_EQUAL(reported(b, touch), n + 1);
        CHECK(touch[n].id == n + 1 && touch[n].confirmed == 0);
        drives(b, 24);
    }
    CHECK(waited[0] >= 1 && waited[1] > 1 && waited[0] <= waited[1] && waited[1] <= 6);
    check_reported(b, 0.3);
    b->on[0] = b->on[1];
    b->fingers = 1;
    drives(b, 4);
    check_reported(b, 0.3); /* touches that stay have not moved */
    CHECK_EQUAL(reported(b, touch), 1);
    CHECK_EQUAL(touch[0].id, 2);
    drives(b, EITS_FAST_GONE + 12);
    put(b, 1, 30, 30, 2);
    drives(b, 12);
    CHECK_EQUAL(reported(b, touch), 2);
    CHECK_EQUAL(touch[1].id, 3);
}

/* A touch that frames find and no drive has its id from the first report of a frame on, and drives
 * follow it by this id. */
TEST(test_drives_follow_a_touch_by_the_id_of_its_frames)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_touch found = {.x_mm = -40, .strength_s_per_m_mm2 = (eits_real)unit(b), .explained = 1};
    eits_touch all[EITS_MAX_TOUCHES];
    eits_fast_touch touch[EITS_FAST_TOUCHES];
    eits_real aligned[SMALL_ROWS];
    uint32_t count = 0;
    for (uint32_t frame = 0; frame < 2; ++frame) {
        drives(b, 8);
        (void)align(b, aligned);
        CHECK_OK(eits_fast_report(b->fast, &found, 1, all, &count));
        CHECK_EQUAL(count, frame);
        CHECK_OK(eits_fast_confirm(b->fast, &found, 1));
    }
    CHECK_EQUAL(all[0].id, 1);
    CHECK_EQUAL(reported(b, touch), 1);
    CHECK_EQUAL(touch[0].id, 1);
    put(b, 0, -40, 0, 1);
    put(b, 1, 40, 0, 1);
    drives(b, 16);
    CHECK_EQUAL(reported(b, touch), 2);
    CHECK(touch[0].id == 1 && touch[1].id == 2);
}

/* Bits that may be reported of those found; all electrodes go with their bit. */
static uint32_t named(bench *b, uint32_t found)
{
    eits_info info = {
        .diagnostics = found, .open_electrodes = 1, .bridged_electrodes = 2, .noisy_electrodes = 4};
    CHECK_OK(eits_fast_name(b->fast, &info));
    CHECK_EQUAL(info.open_electrodes != 0,
                (info.diagnostics & EITS_DIAGNOSTIC_ELECTRODE_OPEN) != 0);
    CHECK_EQUAL(info.bridged_electrodes != 0, (info.diagnostics & EITS_DIAGNOSTIC_BRIDGED) != 0);
    CHECK_EQUAL(info.noisy_electrodes != 0,
                (info.diagnostics & EITS_DIAGNOSTIC_ELECTRODE_NOISY) != 0);
    return info.diagnostics;
}

TEST(test_what_is_named)
{
    enum {
        FAULTS = EITS_DIAGNOSTIC_ELECTRODE_OPEN | EITS_DIAGNOSTIC_BRIDGED |
            EITS_DIAGNOSTIC_ELECTRODE_NOISY | EITS_DIAGNOSTIC_OUTLIER,
        CLIPPED = EITS_DIAGNOSTIC_SATURATED,
        CROWDED = EITS_DIAGNOSTIC_CROWDED
    };
    bench *b = bench_open(EITS_SIGN_INCREASE);
    settle(b, 8);
    CHECK_EQUAL(named(b, FAULTS | CROWDED), FAULTS); /* nothing touches: at once */
    CHECK_EQUAL(named(b, CROWDED), CROWDED);
    CHECK_EQUAL(named(b, 0), 0);
    put(b, 0, 20, 11, 1);
    settle(b, 8); /* it landed */
    CHECK_EQUAL(named(b, FAULTS | CLIPPED), CLIPPED);
    settle(b, 8); /* it stays */
    CHECK_EQUAL(named(b, CLIPPED), CLIPPED);
    CHECK_EQUAL(named(b, FAULTS), FAULTS);
    put(b, 0, 22, 9, 1);
    drives(b, 4);
    put(b, 0, 26, 6, 1);
    settle(b, 4); /* it moved */
    CHECK_EQUAL(named(b, FAULTS | CROWDED), 0);
    CHECK_EQUAL(named(b, FAULTS | CROWDED), FAULTS);
    CHECK_EQUAL(named(b, CROWDED), CROWDED);
    settle(b, 16);
    b->fingers = 0;
    settle(b, 8); /* it lifted */
    CHECK_EQUAL(named(b, 0), 0);
    CHECK_EQUAL(named(b, EITS_DIAGNOSTIC_OUTLIER), 0);
    settle(b, 2 * EITS_FAST_GONE);
    settle(b, 8);
    CHECK_EQUAL(named(b, EITS_DIAGNOSTIC_OUTLIER), EITS_DIAGNOSTIC_OUTLIER);
    CHECK_EQUAL(named(b, EITS_DIAGNOSTIC_OUTLIER), EITS_DIAGNOSTIC_OUTLIER);
    measure(b);
    b->frame[eits_fast_rows(b->fast, b->next, &(uint32_t){0})[2]] += (eits_real)(500 * b->sigma);
    give(b);
    (void)align(b, (eits_real[SMALL_ROWS]){0}); /* the last drive's row may be a contact's first */
    CHECK_EQUAL(named(b, FAULTS), EITS_DIAGNOSTIC_OUTLIER);
    CHECK_EQUAL(named(b, FAULTS), EITS_DIAGNOSTIC_OUTLIER);
    drives(b, 8);
    CHECK_OK(eits_fast_begin(b->fast));
    settle(b, 8);
    CHECK_EQUAL(named(b, CROWDED), 0);
    CHECK_OK(eits_fast_begin(b->fast));
    CHECK_EQUAL(named(b, CROWDED), CROWDED); /* of the frame before */
    (void)align(b, (eits_real[SMALL_ROWS]){0});
    CHECK_EQUAL(named(b, CROWDED), 0);
}

/* Drives follow a gain that drifts; frames say so, from the second on, until it is back. */
TEST(test_a_gain_that_drifts)
{
    enum { STALE = EITS_DIAGNOSTIC_STALE_REFERENCE };
    bench *b = bench_open(EITS_SIGN_INCREASE);
    const double drifts[3] = {0.5 * (double)EITS_FAST_DRIFTED, 0.005, -0.005};
    for (int k = 0; k < 3; ++k) {
        b->gain_drift = drifts[k];
        settle(b, 160);
        CHECK_EQUAL(named(b, 0), 0);
        settle(b, 8);
        CHECK_EQUAL(named(b, 0), k == 0 ? 0 : STALE);
        check_reported(b, 0);
        b->gain_drift = 0;
        settle(b, 160);
        CHECK_EQUAL(named(b, 0), 0);
    }
    b->gain_drift = 0.005;
    settle(b, 160);
    b->fast->noise_v *= 1000; /* so much may be noise */
    settle(b, 8);
    CHECK_EQUAL(named(b, 0), 0);
    b->fast->noise_v /= 1000;
    for (int k = 0; k < 2; ++k) {
        settle(b, 8);
    }
    CHECK_OK(eits_fast_begin(b->fast));
    CHECK_EQUAL(named(b, 0), STALE); /* of the frame before */
    CHANGE_OPTIONS(b->skin.ctx, o.diagnostics &= ~(uint32_t)STALE);
    CHECK_EQUAL(named(b, 0), 0);
    (void)align(b, (eits_real[SMALL_ROWS]){0});
    CHECK_EQUAL(b->fast->drifted, 0);
}

TEST(test_a_clock_that_stands_or_goes_back)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    put(b, 0, -14, 8, 1);
    drives(b, 16);
    const eits_real sure = b->fast->p[0][0];
    for (uint32_t k = 0; k < 16; ++k) {
        b->now_us -= k % 2 == 0 ? DRIVE_US : 2 * DRIVE_US;
        drives(b, 1);
    }
    CHECK(b->fast->p[0][0] < sure);
    check_reported(b, 0.5);
    b->now_us += 60000000; /* a minute: the touch may be anywhere, and is found again */
    drives(b, 24);
    check_reported(b, 1.0);
}

TEST(test_a_touch_that_leaves_the_skin)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    put(b, 0, 40, 0, 1);
    drives(b, 16);
    check_reported(b, 0.5);
    b->fast->state[FAST_X] = 500;
    drives(b, 1);
    CHECK_EQUAL(b->fast->count, 0);
    drives(b, 16);
    check_reported(b, 0.5);
    b->fast->state[FAST_VX] = (eits_real)NAN;
    drives(b, 1);
    CHECK_EQUAL(b->fast->count, 0);
    drives(b, 16);
    check_reported(b, 0.5);
    b->fast->next_id = UINT32_MAX; /* numbers begin again at 1 */
    put(b, 1, -30, 20, 1);
    drives(b, 16);
    CHECK_EQUAL(b->fast->next_id, 1);
}

/* The reference shows that touches of this skin are displaced. They are reported at the corrected
 * places, and a touch that a whole frame finds there is the same one. */
TEST(test_places_that_the_reference_corrects)
{
    for (int there = 0; there < 2; ++there) {
        bench *b = bench_open(EITS_SIGN_INCREASE);
        eits_fast_touch touches[EITS_FAST_TOUCHES];
        const double x = (double)b->skin.model.pixel_mm; /* a shift is at most that */
        b->skin.model.uncertainty.move_terms = 1;
        b->skin.ctx->reference.row_gains = 1;
        b->skin.ctx->reference.shift_mm[0][0] = (eits_real)x;
        b->skin.ctx->reference.shift_mm[1][0] = R(-1);
        drives(b, 40);
        put(b, 0, 12, -20, 1);
        drives(b, 40);
        CHECK_EQUAL(reported(b, touches), 1);
        CHECK_NEAR(touches[0].x_mm, 12 + x, 1);
        CHECK_NEAR(touches[0].y_mm, -21, 1);
        for (uint32_t k = 0; k < EITS_FAST_LOST_FRAMES; ++k)
            confirm(b, (const double[][2]){{12 + x + (there ? 2 * x : -3 * x), -21}}, 1);
        CHECK_EQUAL(b->fast->count > 0 && b->fast->known[0].id == 1, there);
        CHECK(!there || b->fast->known[0].confirmed);
    }
}

TEST(test_answers_and_their_slopes)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    const uint32_t stride = b->fast->most_rows;
    eits_real out[FAST_WAYS * EITS_FAST_ROWS];
    fast_disc disc;
    const finger at = {13.7, -21.2, 1};
    const eits_real place[2] = {(eits_real)at.x_mm, (eits_real)at.y_mm};
    for (uint32_t d = 0; d < eits_fast_drives(b->fast); ++d) {
        uint32_t count;
        const uint16_t *rows = eits_fast_rows(b->fast, d, &count);
        CHECK_EQUAL(count, 5);
        CHECK(eits_fast_gather(b->fast, place, b->fast->rho2, &disc));
        eits_fast_answer(b->fast, d, &disc, out);
        for (uint32_t i = 0; i < count; ++i) {
            const double gain = (double)b->fast->gain[rows[i]], h = 1e-3;
            const finger right = {at.x_mm + h, at.y_mm, 1}, left = {at.x_mm - h, at.y_mm, 1};
            const finger above = {at.x_mm, at.y_mm + h, 1}, below = {at.x_mm, at.y_mm - h, 1};
            const double want = gain * answer(b, rows[i], at), size = gain * unit(b) * b->sigma;
            CHECK_NEAR(out[i], want, 1e-4 * fabs(want) + 1e-12 * size);
            CHECK_NEAR(out[stride + i],
                       gain * (answer(b, rows[i], right) - answer(b, rows[i], left)) / (2 * h),
                       1e-3 * fabs(want));
            CHECK_NEAR(out[2 * stride + i],
                       gain * (answer(b, rows[i], above) - answer(b, rows[i], below)) / (2 * h),
                       1e-3 * fabs(want));
        }
    }
    const eits_real away[2] = {900, 0};
    CHECK(!eits_fast_gather(b->fast, away, b->fast->rho2, &disc));
    CHECK(!eits_fast_on_skin(b->fast, away, b->fast->rho2));
    CHECK(eits_fast_on_skin(b->fast, place, b->fast->rho2));
}

TEST(test_what_is_refused)
{
    bench *b = bench_open(EITS_SIGN_INCREASE);
    eits_fast *made = NULL;
    eits_model *model = &b->skin.model;
    eits_real volts[SMALL_ROWS] = {0};
    eits_fast_touch touches[EITS_FAST_TOUCHES];
    eits_touch found[1];
    eits_info info = {.diagnostics = 0};
    uint32_t count = 0, state;
    uint8_t *memory = b->aligned;
    memset(found, 0, sizeof found);
    CHECK_EQUAL(b->size,
                EITS_FAST_SIZE(SMALL_ROWS, SMALL_ELECTRODES, 5, SMALL_ELECTRODES, SIDE, SIDE));
    CHECK((uint8_t *)(b->fast->ring[EITS_FAST_RING - 1]->known) +
              EITS_REALS(EITS_FAST_TOUCHES * FAST_WAYS * 5) <=
          memory + b->size); /* the last that is laid out */
    CHECK_EQUAL(eits_fast_size(NULL), 0);
    CHECK_REFUSED(eits_fast_init(NULL, b->size, b->skin.ctx, &made));
    CHECK_REFUSED(eits_fast_init(memory, b->size, NULL, &made));
    CHECK_REFUSED(eits_fast_init(memory, b->size, b->skin.ctx, NULL));
    CHECK_EQUAL(eits_fast_init(memory, b->size - 1, b->skin.ctx, &made), EITS_E_WORKSPACE);
    CHECK_EQUAL(eits_fast_init(memory + 8, b->size, b->skin.ctx, &made), EITS_E_WORKSPACE);
    CHECK_EQUAL(eits_fast_drives(NULL), 0);
    CHECK_EQUAL(eits_fast_drives(b->fast), SMALL_ELECTRODES);
    CHECK(eits_fast_rows(NULL, 0, &count) == NULL && eits_fast_rows(b->fast, 0, NULL) == NULL);
    CHECK(eits_fast_rows(b->fast, 8, &count) == NULL);
    CHECK_REFUSED(eits_fast_drive(NULL, 0, volts, 5, 0));
    CHECK_REFUSED(eits_fast_drive(b->fast, 0, NULL, 5, 0));
    CHECK_REFUSED(eits_fast_drive(b->fast, 8, volts, 5, 0));
    CHECK_REFUSED(eits_fast_drive(b->fast, 0, volts, 4, 0));
    CHECK_REFUSED(eits_fast_touches(NULL, touches, 5, &count));
    CHECK_REFUSED(eits_fast_touches(b->fast, NULL, 5, &count));
    CHECK_REFUSED(eits_fast_touches(b->fast, touches, 5, NULL));
    CHECK_REFUSED(eits_fast_align(NULL, volts, SMALL_ROWS, volts, &state));
    CHECK_REFUSED(eits_fast_align(b->fast, NULL, SMALL_ROWS, volts, &state));
    CHECK_REFUSED(eits_fast_align(b->fast, volts, SMALL_ROWS, NULL, &state));
    CHECK_REFUSED(eits_fast_align(b->fast, volts, SMALL_ROWS, volts, NULL));
    CHECK_EQUAL(eits_fast_align(b->fast, volts, 39, volts, &state), EITS_E_FRAME_LENGTH);
    CHECK_REFUSED(eits_fast_confirm(NULL, found, 0));
    CHECK_REFUSED(eits_fast_confirm(b->fast, NULL, 1));
    CHECK_OK(eits_fast_confirm(b->fast, NULL, 0));
    CHECK_REFUSED(eits_fast_confirm(b->fast, found, EITS_MAX_TOUCHES + 1));
    CHECK_REFUSED(eits_fast_name(NULL, &info));
    CHECK_REFUSED(eits_fast_name(b->fast, NULL));
    CHECK_REFUSED(eits_fast_begin(NULL));
    CHECK_OK(eits_reference_set(b->skin.ctx, b->untouched, SMALL_ROWS));
    CHECK_EQUAL(eits_fast_begin(b->fast), EITS_E_REFERENCE_SHORT); /* of unknown noise */
    CHECK_OK(eits_reference_begin(b->skin.ctx, 4));
    CHECK_EQUAL(eits_fast_begin(b->fast), EITS_E_NO_REFERENCE); /* not yet */
    CHECK_EQUAL(eits_fast_drive(b->fast, 0, volts, 5, 0), EITS_E_NO_REFERENCE);
    CHECK_EQUAL(eits_fast_align(b->fast, volts, SMALL_ROWS, volts, &state), EITS_E_NO_REFERENCE);
    /* one drive of all rows, and none of fields */
    uint8_t table[4 * SMALL_ROWS];
    memcpy(table, model->protocol, sizeof table);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        memcpy(table + 4 * i, table, 2);
    model->protocol = table;
    CHECK_EQUAL(eits_fast_size(model),
                EITS_FAST_SIZE(SMALL_ROWS, 0, 0, SMALL_ELECTRODES, SIDE, SIDE));
    model->n_rows = EITS_FAST_ROWS; /* as many as a drive may have */
    CHECK_EQUAL(eits_fast_size(model),
                EITS_FAST_SIZE(EITS_FAST_ROWS, 1, EITS_FAST_ROWS, SMALL_ELECTRODES, SIDE, SIDE));
    model->n_rows = SMALL_ROWS;
    model->fields.at.data = NULL; /* no drives */
    CHECK_EQUAL(eits_fast_size(model),
                EITS_FAST_SIZE(SMALL_ROWS, 0, 0, SMALL_ELECTRODES, SIDE, SIDE));
    CHECK_EQUAL(eits_fast_size(NULL), 0);
    CHECK(made == NULL);
}

RUN_TESTS("fast", (void)bench_open(EITS_SIGN_BOTH))

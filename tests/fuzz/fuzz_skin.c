/* Fingers on a skin in time: a script lays them on, moves and lifts them, loses electrodes and
 * rows; each drive goes the fast way, each frame through the solver, the test of touches and the
 * tracker, and what is reported makes gestures and presses of zones. All numbers must be
 * finite, all counts within their limits.
 *
 * Frames have the data of discs in the model's columns; drives, of the same fingers, the sum over
 * its fields. */
#include "fuzz.h"

#include "base/half.h"
#include "base/vec.h"
#include "dense.h"
#include "small_model.h"

enum {
    RANK = 20,
    SIDE = 12,
    PACKED = RANK * (RANK + 1) / 2,
    FINGERS = 4,
    MAX_FRAMES = 10,
    FAST_BYTES = 1 << 17
};
static const double PIXEL = 6;

typedef struct finger {
    double x_mm, y_mm, radius_mm, change; /* 0: lifted */
    double vx_mm, vy_mm;                  /* a frame */
} finger;

static eits_model model;
static dense d;
static double energy[RANK]; /* of P's rows */
static eits_context *ctx;
static eits_fast *fast;
static eits_gestures gestures;
static eits_zones zones;
static finger on[FINGERS];
static uint32_t now_us;
static uint64_t noise;
static double noise_v, odd_v; /* of each row; of the row `odd` besides */
static uint32_t odd, lost;    /* electrode from 1 */

/* Errors of any direction, as the builder writes them: of a second moment. */
static void fill_errors(uint8_t *packed, double size)
{
    uint64_t state = 17;
    double half[RANK][RANK];
    for (int i = 0; i < RANK * RANK; ++i)
        half[i / RANK][i % RANK] = small_random(&state);
    for (int i = 0; i < RANK; ++i) {
        for (int j = 0; j <= i; ++j, packed += 4)
            small_put_f32(packed, (float)(size * dense_dot(half[i], half[j], RANK)));
    }
}

static void make_model(void)
{
    static uint8_t section[16 + 8 * PACKED];
    small_model bare = small_model_make(
        (small_spec){.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .fields = 1});
    small_put_u32(section, 1);
    small_put_f32(section + 4, 0.04f);
    small_put_f32(section + 8, 0.1f);
    fill_errors(section + 16, 1e-4);
    fill_errors(section + 16 + 4 * PACKED, 1e-5);
    const small_model made = small_model_with_section(&bare, "UNCE", section, sizeof section);
    small_model_free(&bare);
    MUST(eits_model_open(&model, made.blob, made.size) == EITS_OK);
    fuzz_note("models", made.blob, made.size);
    d = dense_of(&model);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        for (uint32_t i = 0; i < RANK; ++i)
            energy[i] += d.p[k * RANK + i] * d.p[k * RANK + i];
    }
}

/* ---- what the skin answers ---- */

/* From 0 to 1: how much of a pixel the finger covers, in sixteenths. */
static double covered(const finger *f, uint32_t pixel)
{
    int inside = 0;
    for (int p = 0; p < 16; ++p) {
        const double x = (double)model.origin_x_mm +
                         (model.pixel[pixel].ix + (p % 4 + 0.5) / 4) * PIXEL - f->x_mm;
        const double y = (double)model.origin_y_mm +
                         (model.pixel[pixel].iy + (p / 4 + 0.5) / 4) * PIXEL - f->y_mm;
        inside += x * x + y * y < f->radius_mm * f->radius_mm;
    }
    return inside / 16.0;
}

/* A row's voltage of its own: noise, something odd, an electrode that is lost. */
static eits_real spoilt(double volts, uint32_t row)
{
    const uint8_t *pins = model.protocol + 4 * (size_t)row;
    const double more = noise_v * small_random(&noise) + (row == odd ? odd_v : 0);
    for (int k = 0; k < 4; ++k)
        volts = pins[k] + 1u == lost ? 0 : volts;
    return (eits_real)(volts + more);
}

/* The frame whose reduced data are S times the fingers' changes. */
static void make_frame(eits_real *frame)
{
    double y[RANK] = {0};
    for (uint32_t j = 0; j < model.n_pixels; ++j) {
        double change = 0;
        for (int k = 0; k < FINGERS; ++k)
            change += on[k].change != 0 ? on[k].change * covered(&on[k], j) : 0;
        for (uint32_t i = 0; i < RANK && change != 0; ++i)
            y[i] += change / (double)model.column_weight[j] * d.s[(size_t)j * RANK + i];
    }
    small_reference(&model, 1.0, frame);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = model.fold[k];
        double volts = 0;
        for (uint32_t i = 0; i < RANK; ++i)
            volts += d.p[k * RANK + i] * y[i] / energy[i];
        frame[fold.first] = spoilt((double)frame[fold.first] + volts, fold.first);
        if (fold.second != EITS_FOLD_NONE)
            frame[fold.second] =
                spoilt((double)frame[fold.second] + fold.sign * volts, fold.second);
    }
}

static double field(uint32_t pixel, uint32_t plus, uint32_t minus, uint32_t from)
{
    const uint16_t *column =
        (const uint16_t *)model.fields.at.data + (size_t)pixel * SMALL_FIELDS_STRIDE + from;
    return (double)eits_half_to_float(column[plus]) - (double)eits_half_to_float(column[minus]);
}

/* The change of a row by the fingers: a sum of E_drive . E_measure. */
static double answer(uint32_t row)
{
    const uint8_t *pins = model.protocol + 4 * (size_t)row;
    double sum = 0;
    for (uint32_t j = 0; j < model.n_pixels; ++j) {
        double change = 0;
        for (int k = 0; k < FINGERS; ++k)
            change += on[k].change != 0 ? on[k].change * covered(&on[k], j) : 0;
        for (uint32_t y = 0; y < 2 * SMALL_ELECTRODES && change != 0; y += SMALL_ELECTRODES)
            sum += change * field(j, pins[0], pins[1], y) * field(j, pins[2], pins[3], y);
    }
    return -(double)model.fields.volts * sum * PIXEL * PIXEL;
}

/* ---- the ways of a frame ---- */

static void drives(void)
{
    eits_fast_touch reported[EITS_FAST_TOUCHES];
    eits_real untouched[SMALL_ROWS], volts[EITS_FAST_ROWS];
    small_reference(&model, 1.0, untouched);
    for (uint32_t drive = 0; drive < eits_fast_drives(fast); ++drive) {
        uint32_t rows, count;
        const uint16_t *row = eits_fast_rows(fast, drive, &rows);
        MUST(row != NULL && rows <= EITS_FAST_ROWS);
        for (uint32_t i = 0; i < rows; ++i)
            volts[i] = spoilt((double)untouched[row[i]] + answer(row[i]), row[i]);
        MUST(eits_fast_drive(fast, drive, volts, rows, now_us) == EITS_OK);
        now_us += 1300;
        MUST(eits_fast_touches(fast, reported, EITS_FAST_TOUCHES, &count) == EITS_OK);
        MUST(count <= EITS_FAST_TOUCHES);
        for (uint32_t k = 0; k < count; ++k) {
            const eits_real *numbers = &reported[k].x_mm;
            for (int n = 0; n < 5; ++n)
                MUST(eits_is_finite(numbers[n]));
            fuzz_note("followed", &reported[k].id, 2 * sizeof(uint32_t));
            fuzz_note_reals("followed", numbers, 5);
        }
        for (int k = 0; k < FINGERS; ++k) {
            on[k].x_mm += on[k].vx_mm / eits_fast_drives(fast);
            on[k].y_mm += on[k].vy_mm / eits_fast_drives(fast);
        }
    }
}

static void note_events(const char *name, const eits_event *events, uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) {
        MUST(eits_is_finite(events[k].x_mm) && eits_is_finite(events[k].y_mm));
        MUST(eits_is_finite(events[k].direction_deg) && eits_is_finite(events[k].value));
        fuzz_note(name, &events[k].kind, 6 * sizeof(uint32_t));
        fuzz_note_reals(name, &events[k].x_mm, 4);
    }
}

static void tell(const eits_touch *touches, uint32_t count)
{
    eits_event events[EITS_MAX_EVENTS], presses[EITS_MAX_ZONE_EVENTS];
    uint32_t reported, pressed;
    MUST(eits_gestures_update(&gestures, touches, count, now_us, events, EITS_MAX_EVENTS,
                              &reported) == EITS_OK);
    MUST(eits_zones_update(&zones, events, reported, presses, EITS_MAX_ZONE_EVENTS, &pressed) ==
         EITS_OK);
    note_events("gestures", events, reported);
    note_events("zones", presses, pressed);
}

/* Ids are those of one touch each, and places are on the skin or next to it. */
static void note_reported(const eits_touch *touches, uint32_t count)
{
    for (uint32_t k = 0; k < count; ++k) {
        const eits_real place[2] = {touches[k].x_mm, touches[k].y_mm};
        MUST(touches[k].id != 0 && eits_is_finite(place[0]) && eits_is_finite(place[1]));
        for (uint32_t l = 0; l < k; ++l)
            MUST(touches[l].id != touches[k].id);
        fuzz_note("reported", &touches[k].id, sizeof touches[k].id);
        fuzz_note_reals("reported", place, 2);
    }
}

static void frame(void)
{
    eits_real volts[SMALL_ROWS], aligned[SMALL_ROWS];
    eits_touch found[EITS_MAX_TOUCHES], reported[EITS_MAX_TOUCHES];
    uint32_t count, reports, state;
    drives();
    make_frame(volts);
    MUST(eits_fast_align(fast, volts, SMALL_ROWS, aligned, &state) == EITS_OK);
    fuzz_note("followed", &state, sizeof state);
    fuzz_note_reals("followed", aligned, SMALL_ROWS);
    const eits_status status = eits_reconstruct(ctx, volts, SMALL_ROWS, NULL, NULL);
    fuzz_check_result(ctx, status, 0);
    MUST(eits_find_touches(ctx, found, EITS_MAX_TOUCHES, &count) == EITS_OK);
    MUST(status == EITS_OK || count == 0);
    fuzz_check_touches(ctx, found, count);
    MUST(eits_fast_report(fast, status == EITS_OK ? found : NULL, count, reported, &reports) ==
         EITS_OK);
    note_reported(reported, reports);
    MUST(eits_fast_confirm(fast, found, count) == EITS_OK);
    tell(reported, reports);
}

/* ---- the script ---- */

static void set_options(uint8_t how, uint8_t more)
{
    static const eits_solver SOLVERS[] = {EITS_SOLVER_FISTA, EITS_SOLVER_WORKING_SET,
                                          EITS_SOLVER_ACTIVE_SET, EITS_SOLVER_ACTIVE_SET};
    eits_options o = *eits_get_options(ctx);
    o.iterations = 12;
    o.sign = (eits_sign)(how % 3);
    o.solver = SOLVERS[how / 4 % 4];
    o.touch_test = !(how & 0x10);
    o.touch_seek = (how & 0x20) != 0;
    o.second_pass = (how & 0x40) != 0;
    o.project_reference = (how & 0x80) != 0;
    o.row_gains = more & 1;
    o.reference_frames = more & 0x40 ? 4 : 0;
    o.test_columns = more & 0x80 ? 100 : 0;
    o.diagnostics = EITS_DIAGNOSTICS_ALL;
    o.max_masked = SMALL_ROWS;
    MUST(eits_set_options(ctx, &o) == EITS_OK);
}

static void begin(fuzz_bytes *in)
{
    static _Alignas(64) uint8_t fast_room[FAST_BYTES];
    static const eits_real key[] = {-30, -30, 0, -30, 0, 0, -30, 0},
                           next[] = {0, 0, 0, -30, 30, -30, 30, 0};
    static const eits_zone zone[] = {{key, 4, 0, 0, 0, 0},
                                     {next, 4, 0, 0, 0, 0},
                                     {NULL, 0, 15, 15, 5, 12},
                                     {NULL, 0, -15, 15, 0, 10}};
    const size_t size = eits_workspace_size(&model, 0), fast_size = eits_fast_size(&model);
    MUST(size <= FUZZ_WORKSPACE && fast_size > 0 && fast_size <= FAST_BYTES);
    MUST(eits_init(fuzz_workspace(0), size, &model, &ctx) == EITS_OK);
    memset(on, 0, sizeof on);
    noise = 5;
    odd_v = 0;
    odd = lost = 0;
    now_us = 0xFFFF0000u; /* the clock wraps */
    const uint8_t how = fuzz_u8(in), more = fuzz_u8(in);
    set_options(how, more);
    noise_v = fuzz_u8(in) * 1e-6;
    MUST(eits_reference_begin(ctx, 8) == EITS_OK);
    for (int k = 0; k < 8; ++k) {
        eits_real volts[SMALL_ROWS];
        make_frame(volts);
        (void)eits_reference_add(ctx, volts, SMALL_ROWS);
    }
    MUST(eits_reference_finish(ctx) == EITS_OK);
    MUST(eits_fast_init(fast_room, fast_size, ctx, &fast) == EITS_OK);
    (void)eits_fast_begin(fast); /* refused without noise */
    MUST(eits_gestures_init(&gestures, NULL) == EITS_OK);
    MUST(eits_zones_init(&zones, zone, sizeof zone / sizeof zone[0]) == EITS_OK);
}

static double signed_byte(fuzz_bytes *in, double unit)
{
    return (int8_t)fuzz_u8(in) * unit;
}

static void step(fuzz_bytes *in, uint32_t *frames)
{
    const uint8_t what = fuzz_u8(in);
    finger *f = &on[what / 8 % FINGERS];
    switch (what % 8) {
    case 0: /* on */
        f->x_mm = signed_byte(in, 0.3), f->y_mm = signed_byte(in, 0.3);
        f->radius_mm = 4 + fuzz_u8(in) * 0.05, f->change = signed_byte(in, 0.0005);
        f->vx_mm = f->vy_mm = 0;
        break;
    case 1: /* it moves */
        f->vx_mm = signed_byte(in, 0.1), f->vy_mm = signed_byte(in, 0.1);
        break;
    case 2: /* off */
        f->change = 0;
        break;
    case 3: /* a row */
        odd = fuzz_u8(in) % SMALL_ROWS, odd_v = signed_byte(in, 0.002);
        break;
    case 4:
        lost = what & 0x80 ? fuzz_u8(in) % (SMALL_ELECTRODES + 1) : 0;
        break;
    case 5: { /* time passes */
        now_us += fuzz_u8(in) * 10000u;
        break;
    }
    default:
        for (uint32_t n = what / 8 % 4 + 1u; n > 0 && *frames < MAX_FRAMES; --n, ++*frames)
            frame();
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (d.s == NULL) {
        make_model();
        fuzz_end_input();
    }
    fuzz_bytes in = {data, data + size};
    begin(&in);
    for (uint32_t frames = 0; in.at < in.end && frames < MAX_FRAMES;)
        step(&in, &frames);
    return 0;
}

/* A firmware's way from drives to touches, on a computer: the workspace and the tracker are static
 * arrays, the model is a constant, and the rows of a frame come drive after drive. The "skin" is
 * the model's golden frame with a little noise.
 *
 * In your firmware replace `measure`, and let the loop over frames have no end. Build it with
 *
 *     scripts/embed out --model python/eitskin/model/paper.eitm
 *     cc -Iout/amalgamation examples/c/stream.c out/amalgamation/eitskin.c -lm -o stream */
#include "eitskin_model.h"

#include <stdio.h>

static _Alignas(16) uint8_t workspace[EITSKIN_MODEL_WORKSPACE];
static _Alignas(16) uint8_t tracker[EITSKIN_MODEL_TRACKER];
static eits_real frame[EITSKIN_MODEL_ROWS];

enum { REFERENCE_FRAMES = 16, FRAMES = 6, DRIVE_US = 1300 };

/* One row's voltage. The golden frame's touches land between frames 0 and 1. */
static eits_real measure(const eits_model *model, int number, uint32_t row)
{
    static uint32_t random = 1;
    random = 1664525u * random + 1013904223u;
    const float noise_v = 1e-5f * ((float)(random >> 8) / 8388608.0f - 1.0f);
    return (number < 1 ? model->golden.reference : model->golden.frame)[row] + noise_v;
}

static void print_touches(int number, const eits_touch *touch, uint32_t count)
{
    printf("frame %d: %u touches\n", number, (unsigned)count);
    for (uint32_t k = 0; k < count; ++k)
        printf("touch %u: (%.1f, %.1f) mm, radius %.1f mm\n", (unsigned)touch[k].id,
               (double)touch[k].x_mm, (double)touch[k].y_mm, (double)touch[k].radius_mm);
}

/* The reference, with its noise: the tracker needs both. */
static eits_status take_reference(eits_context *skin)
{
    const eits_model *model = eits_get_model(skin);
    eits_status status = eits_reference_begin(skin, REFERENCE_FRAMES);
    for (int k = 0; status == EITS_OK && k < REFERENCE_FRAMES; ++k) {
        for (uint32_t row = 0; row < model->n_rows; ++row)
            frame[row] = measure(model, 0, row);
        status = eits_reference_add(skin, frame, model->n_rows);
    }
    return status == EITS_OK ? eits_reference_finish(skin) : status;
}

/* Options for touches that are followed: fainter ones are found, too. */
static eits_status follow_touches(eits_context *skin)
{
    eits_options options = *eits_get_options(skin);
    const eits_status status = eits_options_track(&options);
    return status == EITS_OK ? eits_set_options(skin, &options) : status;
}

/* One scan: each drive goes to the tracker at once, so that a touch is known some milliseconds
 * after contact. Prints the first drive of the frame that has a touch which no frame has shown yet.
 */
static eits_status scan(const eits_model *model, eits_fast *fast, int number, uint32_t *time_us)
{
    eits_status status = EITS_OK;
    int printed = 0;
    for (uint32_t drive = 0; status == EITS_OK && drive < eits_fast_drives(fast); ++drive) {
        uint32_t count;
        const uint16_t *rows = eits_fast_rows(fast, drive, &count);
        eits_real volts[EITS_FAST_ROWS];
        for (uint32_t i = 0; i < count; ++i)
            frame[rows[i]] = volts[i] = measure(model, number, rows[i]);
        *time_us += DRIVE_US;
        status = eits_fast_drive(fast, drive, volts, count, *time_us);
        eits_fast_touch touch[EITS_FAST_TOUCHES];
        if (status == EITS_OK)
            status = eits_fast_touches(fast, touch, EITS_FAST_TOUCHES, &count);
        if (status == EITS_OK && count > 0 && touch[0].confirmed == 0 && !printed)
            printed = printf("frame %d, drive %u: a touch at (%.0f, %.0f) mm\n", number,
                             (unsigned)drive, (double)touch[0].x_mm, (double)touch[0].y_mm);
    }
    return status;
}

/* The whole frame after its last drive: `touch` has room for EITS_MAX_TOUCHES. */
static eits_status solve(eits_context *skin, eits_fast *fast, eits_touch *touch, uint32_t *count)
{
    const uint32_t n_rows = eits_get_model(skin)->n_rows;
    static eits_touch found[EITS_MAX_TOUCHES];
    uint32_t state, n_found = 0;
    eits_status status = eits_fast_align(fast, frame, n_rows, frame, &state);
    if (status != EITS_OK)
        return status;
    if (!(state & EITS_FAST_TRUSTED)) /* a touch changed during the scan: drives know more */
        return eits_fast_report(fast, NULL, 0, touch, count);
    status = eits_reconstruct(skin, frame, n_rows, NULL, NULL);
    if (status == EITS_OK)
        status = eits_find_touches(skin, found, EITS_MAX_TOUCHES, &n_found);
    if (status == EITS_OK)
        status = eits_fast_report(fast, found, n_found, touch, count);
    if (status == EITS_OK)
        status = eits_fast_confirm(fast, found, n_found);
    eits_info info = *eits_get_info(skin);
    return status == EITS_OK ? eits_fast_name(fast, &info) : status; /* then report `info` */
}

int main(void)
{
    static eits_model model;
    static eits_touch touch[EITS_MAX_TOUCHES];
    eits_context *skin = NULL;
    eits_fast *fast = NULL;
    eits_status status = eits_model_open(&model, eitskin_model, sizeof eitskin_model);
    if (status == EITS_OK)
        status = eits_init(workspace, sizeof workspace, &model, &skin);
    if (status == EITS_OK)
        status = follow_touches(skin);
    if (status == EITS_OK)
        status = take_reference(skin);
    if (status == EITS_OK)
        status = eits_fast_init(tracker, sizeof tracker, skin, &fast);
    if (status == EITS_OK)
        status = eits_fast_begin(fast);
    uint32_t time_us = 0, count = 0;
    for (int number = 0; status == EITS_OK && number < FRAMES; ++number) {
        status = scan(&model, fast, number, &time_us);
        if (status == EITS_OK)
            status = solve(skin, fast, touch, &count);
        if (status == EITS_OK)
            print_touches(number, touch, count);
    }
    if (status != EITS_OK)
        fprintf(stderr, "%s\n", eits_status_text(status));
    return status == EITS_OK ? 0 : 1;
}

/* The mistakes of docs/reference/c-api.md, "Calls that fail", in its order, and what the core
 * answers. */
#include "eitskin_model.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static _Alignas(16) uint8_t workspace[EITSKIN_MODEL_WORKSPACE];
static _Alignas(16) uint8_t tracker[EITSKIN_MODEL_TRACKER];
static _Alignas(16) uint8_t other[sizeof eitskin_model + 16];
static eits_real untouched[EITSKIN_MODEL_ROWS], touched[EITSKIN_MODEL_ROWS];
static eits_real wrong[EITSKIN_MODEL_ROWS + 1];
static eits_model model;
static eits_context *skin;

static void say(const char *mistake, eits_status status)
{
    printf("%s: %d\n", mistake, (int)status);
}

static eits_status solve(const eits_real *frame, size_t rows)
{
    return eits_reconstruct(skin, frame, rows, NULL, NULL);
}

static uint32_t touches(eits_status *status)
{
    uint32_t count = 99;
    *status = eits_find_touches(skin, NULL, 0, &count);
    return count;
}

/* A frame of which the first `rows` rows are `value`, or times it. */
static const eits_real *spoiled(uint32_t rows, eits_real value, int times)
{
    for (uint32_t row = 0; row < EITSKIN_MODEL_ROWS; ++row)
        wrong[row] = row >= rows ? touched[row] : times ? value * touched[row] : value;
    return wrong;
}

static void mistake_models(void)
{
    memcpy(other + 4, eitskin_model, sizeof eitskin_model);
    say("unaligned", eits_model_open(&model, other + 4, sizeof eitskin_model));
    say("cut", eits_model_open(&model, eitskin_model, sizeof eitskin_model - 1));
    memcpy(other, eitskin_model, sizeof eitskin_model);
    other[1000] ^= 1;
    say("changed", eits_model_open(&model, other, sizeof eitskin_model));
}

static void mistake_references(void)
{
    say("begin with 3", eits_reference_begin(skin, 3));
    say("add without begin", eits_reference_add(skin, untouched, EITSKIN_MODEL_ROWS));
    say("finish without begin", eits_reference_finish(skin));
    eits_reference_begin(skin, 4);
    eits_reference_add(skin, untouched, EITSKIN_MODEL_ROWS);
    say("finish too early", eits_reference_finish(skin));
}

static void mistake_frames(void)
{
    eits_status status;
    say("length", solve(wrong, EITSKIN_MODEL_ROWS - 1));
    say("NaN in a row", solve(spoiled(1, NAN, 0), EITSKIN_MODEL_ROWS));
    printf("masked: %u\n", (unsigned)eits_get_info(skin)->masked);
    say("NaN", solve(spoiled(EITSKIN_MODEL_ROWS, NAN, 0), EITSKIN_MODEL_ROWS));
    printf("touches of a rejected frame: %u\n", (unsigned)touches(&status));
    say("touches of a rejected frame", status);
    say("zeros", solve(spoiled(EITSKIN_MODEL_ROWS, 0, 0), EITSKIN_MODEL_ROWS));
    say("mV", solve(spoiled(EITSKIN_MODEL_ROWS, 1000, 1), EITSKIN_MODEL_ROWS));
    printf("diagnosed: %d\n", eits_get_info(skin)->diagnostics != 0);
}

int main(void)
{
    mistake_models();
    if (eits_model_open(&model, eitskin_model, sizeof eitskin_model) != EITS_OK)
        return 1;
    for (uint32_t row = 0; row < EITSKIN_MODEL_ROWS; ++row) {
        untouched[row] = model.golden.reference[row];
        touched[row] = model.golden.frame[row];
    }
    say("small workspace", eits_init(workspace, sizeof workspace - 16, &model, &skin));
    say("unaligned workspace", eits_init(workspace + 4, sizeof workspace - 4, &model, &skin));
    if (eits_init(workspace, sizeof workspace, &model, &skin) != EITS_OK)
        return 1;
    eits_status status;
    printf("touches of no frame: %u\n", (unsigned)touches(&status));
    say("touches of no frame", status);
    mistake_references();
    say("no reference", solve(touched, EITSKIN_MODEL_ROWS));
    eits_reference_set(skin, untouched, EITSKIN_MODEL_ROWS);
    mistake_frames();
    eits_options options = *eits_get_options(skin);
    options.iterations = 0;
    say("option", eits_set_options(skin, &options));
    say("row", eits_mask_row(skin, EITSKIN_MODEL_ROWS, 1));
    eits_fast *fast;
    eits_fast_init(tracker, sizeof tracker, skin, &fast);
    say("tracker without noise", eits_fast_begin(fast));
    return 0;
}

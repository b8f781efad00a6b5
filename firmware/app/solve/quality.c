#include "app/solve/quality.h"

#include <math.h>
#include <string.h>

enum {
    FAILED = EITS_QUALITY_SATURATED | EITS_QUALITY_UNSETTLED,
    UNUSABLE = FAILED | EITS_QUALITY_OPEN | EITS_QUALITY_MASKED
};

/* Return the rms of the voltages that the model expects, over all rows that have a fold. */
static float rms_expected(const eits_model *model)
{
    float sum = 0;
    uint32_t count = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const uint32_t sides = model->fold[k].second == EITS_FOLD_NONE ? 1 : 2;
        sum += (float)sides * model->v_ref[k] * model->v_ref[k];
        count += sides;
    }
    return sum > 0 ? sqrtf(sum / (float)count) : 0;
}

static float rms_of_z(const fw_engine *engine, const fw_frame *frame)
{
    float sum = 0;
    uint32_t count = 0;
    for (uint32_t i = 0; i < engine->model.n_rows; ++i) {
        if (engine->flags[i] == 0)
            continue;
        sum += frame->z[i].i * frame->z[i].i + frame->z[i].q * frame->z[i].q;
        ++count;
    }
    return count > 0 ? sqrtf(sum / (float)count) : 0;
}

void fw_quality_prepare(fw_engine *engine, fw_frame *frame)
{
    const bool all = (frame->flags & EITS_RAW_RECIPROCAL) == 0;
    memset(engine->flags, all, engine->model.n_rows);
    for (uint32_t k = 0; !all && k < engine->n_unique; ++k)
        engine->flags[engine->unique[k]] = 1;
    for (uint32_t i = 0; i < engine->model.n_rows; ++i) {
        if (engine->flags[i])
            continue;
        frame->z[i] = (fw_iq){0, 0};
        frame->quality[i] = 0;
    }
}

typedef struct evidence {
    uint32_t significant[FW_MAX_ELECTRODES]; /* rows */
    uint64_t alive;                          /* bit e: a row of electrode e is not dead */
} evidence;

/* Count one row for its electrodes; limit2: the squared magnitude below which it is dead. */
static void weigh(const fw_engine *engine, const fw_frame *frame, uint32_t row, float limit2,
                  evidence *so_far)
{
    if (row == EITS_FOLD_NONE || engine->flags[row] == 0 ||
        (frame->quality[row] & EITS_QUALITY_UNSETTLED) != 0 || eits_is_masked(engine->ctx, row))
        return;
    const fw_iq z = frame->z[row];
    const bool dead =
        (frame->quality[row] & EITS_QUALITY_SATURATED) != 0 || z.i * z.i + z.q * z.q < limit2;
    for (uint32_t k = 0; k < 4; ++k) {
        const uint32_t electrode = engine->model.protocol[4 * (size_t)row + k];
        ++so_far->significant[electrode];
        so_far->alive |= (uint64_t)!dead << electrode;
    }
}

static uint64_t find_open(const fw_engine *engine, const fw_frame *frame)
{
    const eits_model *model = &engine->model;
    const float expected_rms = rms_expected(model), min = FW_OPEN_SIGNIFICANT * expected_rms;
    const float fraction =
        expected_rms > 0 ? FW_OPEN_FRACTION * rms_of_z(engine, frame) / expected_rms : 0;
    evidence found = {.alive = 0};
    uint64_t open = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const float expected2 = model->v_ref[k] * model->v_ref[k];
        if (!(expected2 > min * min))
            continue;
        weigh(engine, frame, model->fold[k].first, fraction * fraction * expected2, &found);
        weigh(engine, frame, model->fold[k].second, fraction * fraction * expected2, &found);
    }
    for (uint32_t e = 0; e < model->n_electrodes; ++e) {
        if (found.significant[e] >= FW_OPEN_MIN_ROWS && (found.alive >> e & 1u) == 0)
            open |= (uint64_t)1 << e;
    }
    return open;
}

static void mark_open(const fw_engine *engine, fw_frame *frame, uint64_t open)
{
    for (uint32_t i = 0; open != 0 && i < engine->model.n_rows; ++i) {
        const uint8_t *row = engine->model.protocol + 4 * (size_t)i;
        if (((open >> row[0] | open >> row[1] | open >> row[2] | open >> row[3]) & 1u) != 0)
            frame->quality[i] |= EITS_QUALITY_OPEN;
    }
}

static void check_reciprocity(const fw_engine *engine, fw_frame *frame, fw_quality *quality)
{
    const eits_model *model = &engine->model;
    const float all = rms_of_z(engine, frame);
    float worst = 0;
    quality->checked = all > 0;
    for (uint32_t k = 0; k < model->n_folded && quality->checked; ++k) {
        const eits_fold fold = model->fold[k];
        if (fold.second == EITS_FOLD_NONE ||
            ((frame->quality[fold.first] | frame->quality[fold.second]) & UNUSABLE) != 0)
            continue;
        const float off = frame->volts[fold.first] - (float)fold.sign * frame->volts[fold.second];
        const float fraction = (off < 0 ? -off : off) / all;
        if (fraction > FW_RECIPROCITY_FRACTION) {
            frame->quality[fold.first] |= EITS_QUALITY_RECIPROCITY;
            frame->quality[fold.second] |= EITS_QUALITY_RECIPROCITY;
        }
        if (fraction > worst) {
            worst = fraction;
            quality->worst_row = fold.first;
        }
    }
    quality->worst_permille = (uint32_t)(1000 * (worst < 1000 ? worst : 1000) + 0.5f);
}

/* Copy the value of each fold's first row to its second row. */
static void copy_reciprocals(const fw_engine *engine, fw_frame *frame)
{
    for (uint32_t k = 0; k < engine->model.n_folded; ++k) {
        const eits_fold fold = engine->model.fold[k];
        if (fold.second == EITS_FOLD_NONE)
            continue;
        frame->volts[fold.second] = (float)fold.sign * frame->volts[fold.first];
        frame->quality[fold.second] =
            (uint8_t)((frame->quality[fold.first] & ~(unsigned)EITS_QUALITY_MASKED) |
                      EITS_QUALITY_COPIED);
    }
}

void fw_quality_check(fw_engine *engine, fw_frame *frame, bool by_model, fw_quality *quality)
{
    const uint32_t rows = engine->model.n_rows;
    *quality = (fw_quality){.open = by_model ? find_open(engine, frame) : 0};
    mark_open(engine, frame, quality->open);
    for (uint32_t i = 0; i < rows; ++i) {
        if (eits_is_masked(engine->ctx, i))
            frame->quality[i] |= EITS_QUALITY_MASKED;
    }
    if ((frame->flags & EITS_RAW_RECIPROCAL) == 0)
        check_reciprocity(engine, frame, quality);
    if ((frame->flags & (EITS_RAW_RECIPROCAL | EITS_RAW_CHECK)) != 0)
        copy_reciprocals(engine, frame);
    for (uint32_t i = 0; i < rows; ++i) {
        if (eits_is_masked(engine->ctx, i))
            frame->quality[i] |= EITS_QUALITY_MASKED;
        const bool saturated =
            (frame->quality[i] & EITS_QUALITY_SATURATED) != 0 && !eits_is_masked(engine->ctx, i);
        if (saturated && quality->saturated++ == 0)
            quality->first_saturated = i;
        if ((frame->quality[i] & UNUSABLE) != 0)
            frame->volts[i] = (float)NAN;
    }
}

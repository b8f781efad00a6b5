#include "app/solve/phase.h"

#include <math.h>

static bool usable(const fw_frame *frame, uint32_t row)
{
    return row != EITS_FOLD_NONE && frame->quality[row] == 0;
}

static float turned(const fw_engine *engine, fw_iq z)
{
    return z.i * engine->cosine + z.q * engine->sine;
}

/* Scalar product with the model's reference. */
static float along_model(const fw_engine *engine, const fw_frame *frame)
{
    float sum = 0;
    for (uint32_t k = 0; k < engine->model.n_folded; ++k) {
        const eits_fold fold = engine->model.fold[k];
        if (usable(frame, fold.first))
            sum += engine->model.v_ref[k] * turned(engine, frame->z[fold.first]);
        if (usable(frame, fold.second))
            sum +=
                engine->model.v_ref[k] * (float)fold.sign * turned(engine, frame->z[fold.second]);
    }
    return sum;
}

void fw_phase_learn(fw_engine *engine, const fw_frame *frame)
{
    float re = 0, im = 0; /* of the sum of z^2 */
    for (uint32_t i = 0; i < engine->model.n_rows; ++i) {
        const fw_iq z = frame->z[i];
        if (!usable(frame, i))
            continue;
        re += z.i * z.i - z.q * z.q;
        im += 2 * z.i * z.q;
    }
    const float size = sqrtf(re * re + im * im);
    if (!(size > 0))
        return;
    /* half-angle formulas; the larger of cosine and sine comes first, so that nothing cancels */
    const float c = re / size, s = im / size;
    if (c >= 0) {
        engine->cosine = sqrtf(0.5f * (1 + c));
        engine->sine = s / (2 * engine->cosine);
    } else {
        engine->sine = sqrtf(0.5f * (1 - c));
        engine->cosine = s / (2 * engine->sine);
    }
    if (along_model(engine, frame) < 0) {
        engine->cosine = -engine->cosine;
        engine->sine = -engine->sine;
    }
}

void fw_phase_apply(const fw_engine *engine, fw_frame *frame)
{
    for (uint32_t i = 0; i < engine->model.n_rows; ++i)
        frame->volts[i] = turned(engine, frame->z[i]);
}

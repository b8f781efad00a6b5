#include "hand.h"

#include "base/vec.h"
#include "kernels/kernels.h"

enum { CYCLE = 96, PRESS = 12, HOLD = 60 }; /* frames: a finger's coming and going */

static const eits_real NOISE = R(3e-5); /* relative to the voltages' rms */

uint32_t hand_draw(hand *h, uint32_t count)
{
    h->random = h->random * 1664525u + 1013904223u;
    return (uint32_t)((uint64_t)(h->random >> 8) * count >> 24);
}

/* Uniform in [-1, 1). */
static eits_real uniform(hand *h)
{
    return (eits_real)hand_draw(h, 1u << 16) * R(1.0 / 32768.0) - 1;
}

static const float *reduction_column(const eits_model *model, uint32_t k)
{
    return (const float *)model->reduction.data + (size_t)model->reduction.stride * k;
}

/* P P' + a little, factored. */
static void factor(hand *h)
{
    const uint32_t rank = h->model->rank;
    eits_real trace = 0;
    for (uint32_t i = 0; i < rank; ++i) {
        for (uint32_t j = 0; j <= i; ++j) {
            eits_real sum = 0;
            for (uint32_t k = 0; k < h->model->n_folded; ++k)
                sum += (eits_real)reduction_column(h->model, k)[i] *
                       (eits_real)reduction_column(h->model, k)[j];
            h->factor[i][j] = sum;
        }
        trace += h->factor[i][i];
    }
    for (uint32_t i = 0; i < rank; ++i) {
        for (uint32_t j = 0; j <= i; ++j) {
            eits_real sum = h->factor[i][j] + (i == j ? R(1e-5) * trace / (eits_real)rank : 0);
            for (uint32_t k = 0; k < j; ++k)
                sum -= h->factor[i][k] * h->factor[j][k];
            h->factor[i][j] = i == j ? eits_sqrt(sum) : sum / h->factor[j][j];
        }
    }
}

static void solve(const hand *h, eits_real *y)
{
    const uint32_t rank = h->model->rank;
    for (uint32_t i = 0; i < rank; ++i) {
        for (uint32_t k = 0; k < i; ++k)
            y[i] -= h->factor[i][k] * y[k];
        y[i] /= h->factor[i][i];
    }
    for (uint32_t i = rank; i-- > 0;) {
        for (uint32_t k = i + 1; k < rank; ++k)
            y[i] -= h->factor[k][i] * y[k];
        y[i] /= h->factor[i][i];
    }
}

int hand_begin(hand *h, const eits_model *model)
{
    if (model->n_rows > MAX_ROWS || model->n_folded > MAX_FOLDED || model->rank > MAX_RANK ||
        model->data_kind != EITS_DATA_DIFFERENCE)
        return 0;
    *h = (hand){.model = model, .random = 20260};
    eits_real squares = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        const eits_real v = (eits_real)model->v_ref[k];
        h->untouched[fold.first] = v;
        if (fold.second != EITS_FOLD_NONE)
            h->untouched[fold.second] = (eits_real)fold.sign * v;
        squares += v * v;
    }
    h->rms = eits_sqrt(squares / (eits_real)model->n_folded);
    factor(h);
    return 1;
}

/* How hard finger f presses in frame k: 0 to 1. */
static eits_real pressure(uint64_t k, uint32_t f)
{
    const uint32_t at = (uint32_t)((k + (uint64_t)f * 37) % CYCLE);
    if (at < PRESS)
        return (eits_real)at / PRESS;
    if (at < HOLD)
        return 1;
    return at < HOLD + PRESS ? (eits_real)(HOLD + PRESS - at) / PRESS : 0;
}

/* A place that goes to and fro between 0 and 1, `period` frames there and back. */
static eits_real to_and_fro(uint64_t k, uint32_t period)
{
    const uint32_t at = (uint32_t)(k % period);
    return (eits_real)(at < period / 2 ? 2 * at : 2 * (period - at)) / (eits_real)period;
}

/* Add S x for the pixels under finger f, all of one change. */
static void press(const hand *h, uint64_t k, uint32_t f, eits_real *y)
{
    const eits_model *m = h->model;
    const eits_real change = pressure(k, f) * (eits_real)m->defaults->touch_change_s_per_m;
    const eits_real x =
        (eits_real)m->nx * (R(0.2) + R(0.6) * to_and_fro(k + 77 * f, 701 + 130 * f));
    const eits_real yy =
        (eits_real)m->ny * (R(0.2) + R(0.6) * to_and_fro(k + 251 * f, 463 + 190 * f));
    const eits_real radius = R(1.5) + (eits_real)f * R(0.5);
    if (change == 0)
        return;
    for (uint32_t j = 0; j < m->n_pixels; ++j) {
        const eits_real dx = (eits_real)m->pixel[j].ix + R(0.5) - x,
                        dy = (eits_real)m->pixel[j].iy + R(0.5) - yy;
        if (dx * dx + dy * dy > radius * radius)
            continue;
        eits_real column[MAX_RANK];
        eits_read_column(&m->sensitivity, j, column);
        const eits_real scale =
            m->sensitivity.scale != NULL ? (eits_real)m->sensitivity.scale[j] : 1;
        for (uint32_t i = 0; i < m->rank; ++i)
            y[i] += change * scale * column[i] / (eits_real)m->column_weight[j];
    }
}

void hand_frame(hand *h, uint64_t k, eits_real gain, int touched, eits_real *frame)
{
    const eits_model *m = h->model;
    eits_real y[MAX_RANK] = {0};
    for (uint32_t f = 0; touched && f < FINGERS; ++f)
        press(h, k, f, y);
    solve(h, y);
    for (uint32_t i = 0; i < m->n_rows; ++i)
        frame[i] = gain * h->untouched[i] + NOISE * h->rms * uniform(h);
    for (uint32_t fold = 0; fold < m->n_folded; ++fold) {
        const float *column = reduction_column(m, fold);
        eits_real d = 0;
        for (uint32_t i = 0; i < m->rank; ++i)
            d += (eits_real)column[i] * y[i];
        frame[m->fold[fold].first] += gain * d;
        if (m->fold[fold].second != EITS_FOLD_NONE)
            frame[m->fold[fold].second] += gain * (eits_real)m->fold[fold].sign * d;
    }
}

#include "dense.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

double *dense_numbers(size_t count)
{
    double *made = calloc(count + 1, sizeof *made);
    if (made == NULL)
        abort();
    return made;
}

double *dense_copy(const eits_real *a, size_t count)
{
    double *made = dense_numbers(count);
    for (size_t i = 0; i < count; ++i)
        made[i] = (double)a[i];
    return made;
}

double dense_entry(const eits_matrix *matrix, uint32_t column, uint32_t row)
{
    const size_t at = (size_t)matrix->stride * column + row;
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        return (double)((const float *)matrix->data)[at];
    case EITS_STORAGE_I16:
        return ((const int16_t *)matrix->data)[at];
    case EITS_STORAGE_I8:
        return ((const int8_t *)matrix->data)[at];
    case EITS_STORAGE_F16:
        break;
    }
    const uint16_t half = ((const uint16_t *)matrix->data)[at];
    const int exponent = (half >> 10) & 31, fraction = half & 1023;
    const double value =
        exponent == 0 ? ldexp(fraction, -24) : ldexp(1024 + fraction, exponent - 25);
    return half & 0x8000 ? -value : value;
}

static double *dense_matrix(const eits_matrix *matrix)
{
    double *made = dense_numbers((size_t)matrix->rows * matrix->cols);
    for (uint32_t j = 0; j < matrix->cols; ++j) {
        const double scale = matrix->scale != NULL ? (double)matrix->scale[j] : 1.0;
        for (uint32_t i = 0; i < matrix->rows; ++i)
            made[(size_t)j * matrix->rows + i] = scale * dense_entry(matrix, j, i);
    }
    return made;
}

dense dense_of(const eits_model *model)
{
    const dense d = {model->rank, model->n_pixels, model->n_folded,
                     dense_matrix(&model->sensitivity), dense_matrix(&model->reduction)};
    return d;
}

void dense_free(dense *d)
{
    free(d->s);
    free(d->p);
    d->s = d->p = NULL;
}

void dense_residual(const dense *d, const double *y, const double *x, double *r)
{
    memcpy(r, y, d->rank * sizeof *r);
    for (uint32_t j = 0; j < d->n; ++j) {
        for (uint32_t i = 0; i < d->rank; ++i)
            r[i] -= d->s[(size_t)j * d->rank + i] * x[j];
    }
}

void dense_correlate(const dense *d, const double *r, double *c)
{
    for (uint32_t j = 0; j < d->n; ++j)
        c[j] = dense_dot(d->s + (size_t)j * d->rank, r, d->rank);
}

double dense_dot(const double *a, const double *b, size_t count)
{
    double sum = 0;
    for (size_t i = 0; i < count; ++i)
        sum += a[i] * b[i];
    return sum;
}

double dense_greatest_difference(const double *a, const eits_real *b, size_t count)
{
    double max = 0;
    for (size_t i = 0; i < count; ++i) {
        const double off = fabs(a[i] - (double)b[i]);
        if (!(off <= max))
            max = off; /* NaN stays */
    }
    return max;
}

double dense_objective(const dense *d, const double *y, const double *x, double lambda)
{
    double *r = dense_numbers(d->rank), l1 = 0;
    dense_residual(d, y, x, r);
    for (uint32_t j = 0; j < d->n; ++j)
        l1 += fabs(x[j]);
    const double value = 0.5 * dense_dot(r, r, d->rank) + lambda * l1;
    free(r);
    return value;
}

double dense_gap(const dense *d, const double *y, const double *x, double lambda, eits_sign sign)
{
    double *r = dense_numbers(d->rank), *c = dense_numbers(d->n), largest = 0;
    dense_residual(d, y, x, r);
    dense_correlate(d, r, c);
    for (uint32_t j = 0; j < d->n; ++j) {
        const double along =
            sign == EITS_SIGN_INCREASE ? c[j] : (sign == EITS_SIGN_DECREASE ? -c[j] : fabs(c[j]));
        largest = along > largest ? along : largest;
    }
    const double t = largest > lambda ? lambda / largest : 1.0;
    double dual = 0.5 * dense_dot(y, y, d->rank);
    for (uint32_t i = 0; i < d->rank; ++i)
        dual -= 0.5 * (y[i] - t * r[i]) * (y[i] - t * r[i]);
    free(r);
    free(c);
    return dense_objective(d, y, x, lambda) - dual;
}

static double soft(double v, double threshold, eits_sign sign)
{
    if (v > threshold && sign != EITS_SIGN_DECREASE)
        return v - threshold;
    if (v < -threshold && sign != EITS_SIGN_INCREASE)
        return v + threshold;
    return 0;
}

void dense_fista(const dense *d, const double *y, double lambda, double lipschitz,
                 uint32_t iterations, eits_sign sign, double *x)
{
    double *z = dense_numbers(d->n), *r = dense_numbers(d->rank), *c = dense_numbers(d->n), t = 1;
    memcpy(z, x, d->n * sizeof *z);
    for (uint32_t k = 0; k < iterations; ++k) {
        const double t_next = 0.5 * (1 + sqrt(1 + 4 * t * t));
        dense_residual(d, y, z, r);
        dense_correlate(d, r, c);
        for (uint32_t j = 0; j < d->n; ++j) {
            const double next = soft(z[j] + c[j] / lipschitz, lambda / lipschitz, sign);
            z[j] = next + (t - 1) / t_next * (next - x[j]);
            x[j] = next;
        }
        t = t_next;
    }
    free(z);
    free(r);
    free(c);
}

void dense_project_out(double *v, double *directions, uint32_t count, uint32_t rank)
{
    for (uint32_t k = 0; k <= count; ++k) {
        double *a = k < count ? directions + (size_t)k * rank : v;
        const double before = sqrt(dense_dot(a, a, rank));
        for (int pass = 0; pass < 2; ++pass) {
            for (uint32_t l = 0; l < k; ++l) {
                const double *b = directions + (size_t)l * rank, along = dense_dot(a, b, rank);
                for (uint32_t i = 0; i < rank; ++i)
                    a[i] -= along * b[i];
            }
        }
        const double norm = sqrt(dense_dot(a, a, rank));
        for (uint32_t i = 0; k < count && i < rank; ++i)
            a[i] = norm > 1e-6 * before ? a[i] / norm : 0;
    }
}

static double datum(eits_data_kind kind, double gain, double v, double v0)
{
    switch (kind) {
    case EITS_DATA_DIFFERENCE:
        break;
    case EITS_DATA_NORMALISED:
        return (v - v0) / v0;
    case EITS_DATA_LOG_RATIO:
        return gain * v0 * log(fmin(16, fmax(1.0 / 16, v / v0)));
    }
    return gain * (v - v0);
}

void dense_frame(const eits_model *model, const dense *d, const double *v0, double gain,
                 const double *v0_drift, const eits_real *frame, const uint8_t *out, double *y)
{
    const uint32_t rank = d->rank;
    const int turns = model->data_kind != EITS_DATA_NORMALISED;
    double *directions = dense_numbers((size_t)rank * (d->folded + 1));
    double *drift = dense_numbers(rank);
    uint32_t count = 0;
    memset(y, 0, rank * sizeof *y);
    for (uint32_t k = 0; k < d->folded; ++k) {
        const double *column = d->p + (size_t)k * rank;
        const eits_fold fold = model->fold[k];
        double sum = 0, along = 0, used = 0;
        for (int side = 0; side < 2; ++side) {
            const uint32_t row = side == 0 ? fold.first : fold.second;
            const double sign = side == 1 && turns ? fold.sign : 1;
            if (row == EITS_FOLD_NONE || out[row])
                continue;
            sum += sign * datum(model->data_kind, gain, (double)frame[row], v0[row]);
            along += v0_drift == NULL ? 0 : (turns ? sign * gain * v0_drift[row] : 1);
            used += 1;
        }
        for (uint32_t i = 0; i < rank; ++i) {
            if (used > 0) {
                y[i] += column[i] * sum / used;
                drift[i] += column[i] * along / used;
            } else {
                directions[(size_t)count * rank + i] = column[i];
            }
        }
        count += used == 0;
    }
    if (v0_drift != NULL)
        memcpy(directions + (size_t)count++ * rank, drift, rank * sizeof *drift);
    dense_project_out(y, directions, count, rank);
    free(directions);
    free(drift);
}

void dense_bench_close(dense_bench *bench)
{
    dense_free(&bench->d);
    small_context_close(&bench->c);
    small_model_free(&bench->made);
}

eits_context *dense_bench_take(dense_bench *bench, small_model made, int prepared)
{
    dense_bench_close(bench);
    bench->made = made;
    small_model_seal(&bench->made);
    small_context_open(&bench->c, &bench->made, prepared);
    bench->d = dense_of(&bench->c.model);
    return bench->c.ctx;
}

eits_context *dense_bench_open(dense_bench *bench, small_spec spec, int prepared)
{
    return dense_bench_take(bench, small_model_make(spec), prepared);
}

/* The metric of the joint fit, and what no touch causes.
 *
 * Folds have independent errors, each of a variance of its own: noise, and what the multipole model
 * itself errs by, which grows with the fold's datum. Beside these, the data may have any amount of
 * the drift of the gain, and the model's errors: the second moment s |d|^2 sum e e' (section ROWE),
 * where s grows with the square of the distance of the
 * reference from the model. With W the weights, B the columns W e s^1/2 |d| and g the direction of
 * the drift in that metric,
 *
 *     (W^-2 + errors + infinity g g')^-1 = W (1 - [g B] M^-1 [g B]') W,
 *     M = [g B]'[g B] + diag(0, 1, ..., 1) = L L'
 *
 * so that products of weighted columns lose the products of L^-1 [g B]' times these columns. */
#include "joint/joint.h"

#include "base/cholesky.h"
#include "base/vec.h"
#include "context/places.h"
#include "diagnostics/diagnostics.h"
#include "joint/constants.h"
#include "kernels/kernels.h"

uint32_t eits_joint_folds(const eits_context *ctx)
{
    uint32_t used = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k)
        used += ctx->frame.sides[k] != EITS_SIDE_NONE;
    return used;
}

eits_real eits_joint_freedom(const eits_context *ctx, const eits_joint *j)
{
    const eits_real free =
        (eits_real)eits_joint_folds(ctx) - 1 - (eits_real)(EITS_JOINT_DISC * j->count);
    return eits_larger(free, EITS_JOINT_MIN_FREEDOM);
}

eits_real eits_joint_excess(const eits_context *ctx, const eits_joint *j)
{
    return eits_larger(j->misfit / eits_joint_freedom(ctx, j), 1);
}

/* |W d|^2 less its part along the drift. */
static eits_real data_energy(const eits_context *ctx)
{
    const eits_joint_memory *m = &ctx->joint;
    eits_real square = 0, along = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_real d = m->weight[k] * ctx->frame.d[k];
        square = eits_fma(d, d, square);
        along = eits_fma(d, m->drift[k], along);
    }
    return eits_fma(-along, along, square);
}

/* The direction of the gain's drift in the metric of the weights. */
static void aim_drift(eits_context *ctx)
{
    eits_joint_memory *m = &ctx->joint;
    eits_real square = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        m->drift[k] = m->weight[k] * ctx->projection.gain_drift[k];
        square = eits_fma(m->drift[k], m->drift[k], square);
    }
    const eits_real norm = square > 0 ? 1 / eits_sqrt(square) : 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k)
        m->drift[k] *= norm;
}

/* The weights 1 / sigma of the folds in use. A fold's variance is that of its noise, and the
 * squared errors of the multipole model: a share of what touches change in this fold, and a share
 * of what they change in the mean. `energy` is that of the data. */
static void weigh_folds(eits_context *ctx, eits_real energy)
{
    eits_joint_memory *m = &ctx->joint;
    const eits_real least = EITS_JOINT_MIN_NOISE * ctx->reference.gain * ctx->reference.v0_rms,
                    folds = (eits_real)eits_joint_folds(ctx),
                    common = EITS_JOINT_MODEL_ERROR * EITS_JOINT_MODEL_ERROR * energy /
                             eits_larger(folds, 1);
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_real own = EITS_JOINT_OWN_ERROR * ctx->frame.d[k],
                        noise = eits_larger(eits_fold_noise(ctx, k), least * least);
        m->weight[k] /= eits_sqrt(eits_fma(own, own, noise + common));
    }
}

/* s |d|^2 */
static eits_real error_energy(const eits_context *ctx, eits_real energy)
{
    const eits_real far = ctx->reference.distance / (eits_real)ctx->model->row_errors.distance;
    return EITS_JOINT_ERROR_SHARE * (far < 1 ? far * far : 1) * energy;
}

/* Vectors are stored strongest first; the rest would be far below the noise. */
static uint32_t errors_above_noise(const eits_context *ctx, eits_real errors)
{
    const eits_row_errors *e = &ctx->model->row_errors;
    eits_real size[EITS_MAX_PLACE_ROWS] = {0};
    uint32_t count = 0;
    if (!(errors > 0))
        return 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        for (uint32_t i = 0; i < e->count; ++i) {
            const eits_real v =
                ctx->joint.weight[k] * (eits_real)e->vectors[(size_t)e->count * k + i];
            size[i] = eits_fma(v, v, size[i]);
        }
    }
    while (count < e->count && errors * size[count] > EITS_JOINT_ERROR_MIN)
        ++count;
    return count;
}

/* Sums with four vectors. They are four variables and no array, so that a compiler keeps them in
 * registers: with two columns at a time they fit those of a Cortex-M7. */
typedef struct four {
    eits_real a, b, c, d;
} four;

static inline four read_four(const eits_real *along)
{
    return (four){along[0], along[1], along[2], along[3]};
}

static inline void write_four(eits_real *along, four s)
{
    along[0] = s.a;
    along[1] = s.b;
    along[2] = s.c;
    along[3] = s.d;
}

static inline four plus_four(four s, eits_real x, const float *vector)
{
    return (four){eits_fma(x, (eits_real)vector[0], s.a), eits_fma(x, (eits_real)vector[1], s.b),
                  eits_fma(x, (eits_real)vector[2], s.c), eits_fma(x, (eits_real)vector[3], s.d)};
}

/* Add two columns' products with the vectors in use, over folds first ... first + count - 1; their
 * unit is missing. */
static void along_errors(const eits_context *ctx, const eits_real *const column[2], uint32_t first,
                         uint32_t count, eits_real *const along[2])
{
    const eits_row_errors *e = &ctx->model->row_errors;
    const float *vectors = e->vectors + (size_t)e->count * first;
    uint32_t i = 0;
    for (; i + 4u <= ctx->joint.errors; i += 4u) {
        four s = read_four(along[0] + i), t = read_four(along[1] + i);
        for (uint32_t k = 0; k < count; ++k) {
            const float *vector = vectors + (size_t)e->count * k + i;
            s = plus_four(s, column[0][k], vector);
            t = plus_four(t, column[1][k], vector);
        }
        write_four(along[0] + i, s);
        write_four(along[1] + i, t);
    }
    for (; i < ctx->joint.errors; ++i) {
        for (uint32_t c = 0; c < 2; ++c) {
            for (uint32_t k = 0; k < count; ++k)
                along[c][i] = eits_fma(column[c][k], (eits_real)vectors[(size_t)e->count * k + i],
                                       along[c][i]);
        }
    }
}

/* M and its factor. */
static uint64_t factor_nuisances(eits_context *ctx)
{
    eits_joint_memory *m = &ctx->joint;
    const eits_row_errors *e = &ctx->model->row_errors;
    const uint32_t folds = ctx->model->n_folded, n = 1u + m->errors;
    eits_zero(m->nuisance, EITS_LOWER_SIZE(n));
    for (uint32_t k = 0; k < folds && n > 1; ++k) {
        const float *vector = e->vectors + (size_t)e->count * k;
        const eits_real on = m->weight[k] * m->error_unit;
        for (uint32_t i = 1; i < n; ++i) {
            eits_real *row = eits_lower_row(m->nuisance, i);
            const eits_real v = on * (eits_real)vector[i - 1u];
            row[0] = eits_fma(v, m->drift[k], row[0]);
            for (uint32_t j = 1; j <= i; ++j)
                row[j] = eits_fma(v, on * (eits_real)vector[j - 1u], row[j]);
        }
    }
    m->nuisance[0] = 1; /* where there is no drift, no column has a part along it */
    for (uint32_t i = 1; i < n; ++i) {
        eits_real *row = eits_lower_row(m->nuisance, i);
        row[i] += 1;
        /* at least the 1 just added but for rounding */
        row[i] = eits_sqrt(eits_larger(eits_cholesky_row(m->nuisance, i), R(0.5)));
    }
    return (uint64_t)folds * n * n / 2u + (uint64_t)n * n * n / 6u;
}

uint64_t eits_joint_metric(eits_context *ctx)
{
    eits_joint_memory *m = &ctx->joint;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k)
        m->weight[k] = ctx->frame.sides[k] == EITS_SIDE_NONE ? 0 : 1;
    aim_drift(ctx);
    m->whole = data_energy(ctx);
    weigh_folds(ctx, m->whole);
    aim_drift(ctx);
    m->energy = data_energy(ctx);
    const eits_real errors = error_energy(ctx, m->whole);
    m->errors = errors_above_noise(ctx, errors);
    m->error_unit = eits_sqrt(errors);
    return factor_nuisances(ctx);
}

/* Weigh a weighted column once more, as the vectors of the errors are. */
static void weigh_again(const eits_context *ctx, const eits_real *column, uint32_t first,
                        uint32_t count, eits_real *out)
{
    for (uint32_t k = 0; k < count; ++k)
        out[k] = column[k] * ctx->joint.weight[first + k];
}

void eits_joint_add_along(const eits_context *ctx, const eits_real *columns, uint32_t n,
                          uint32_t first, uint32_t count, eits_real *along)
{
    eits_real unused[EITS_JOINT_NUISANCES] = {0}, weighed[2][EITS_JOINT_BLOCK];
    for (uint32_t c = 0; c < n; c += 2u) {
        const int alone = c + 1u == n;
        eits_real *const out[2] = {along + (size_t)EITS_JOINT_NUISANCES * c,
                                   alone ? unused
                                         : along + (size_t)EITS_JOINT_NUISANCES * (c + 1u)},
                         *const errors[2] = {out[0] + 1, out[1] + 1};
        const eits_real *const pair[2] = {weighed[0], weighed[1]};
        for (uint32_t l = 0; l < 2; ++l) {
            const eits_real *column = columns + (size_t)EITS_JOINT_BLOCK * (alone ? c : c + l);
            out[l][0] += eits_dot(ctx->kernels, column, ctx->joint.drift + first, count);
            if (ctx->joint.errors > 0)
                weigh_again(ctx, column, first, count, weighed[l]);
        }
        along_errors(ctx, pair, first, count, errors);
    }
}

void eits_joint_finish_along(eits_context *ctx, eits_real *along)
{
    for (uint32_t i = 0; i < ctx->joint.errors; ++i)
        along[i + 1u] *= ctx->joint.error_unit;
    eits_lower_solve(ctx->joint.nuisance, 1u + ctx->joint.errors, along);
}

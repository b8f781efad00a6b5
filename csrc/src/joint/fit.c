/* F, its normal equations, and the way to its minimum.
 *
 * Slopes hold the induced field, which each evaluation carries one round further: it follows the
 * shapes as they settle. Folds are taken in blocks, so that the columns of all parameters need
 * memory for one block and not for the whole frame; of the whole frame there are the normal
 * equations alone, and of each column and of the data its products with what no touch causes
 * (metric.c), which are taken out at the end.
 *
 * Levenberg's and Marquardt's damping, relative to the diagonal: a step that does not lower F is
 * tried again, damped more; one that does lowers the damping. Each step is shortened as a whole
 * where a parameter would move further than the linearisation holds. */
#include "joint/joint.h"

#include "base/cholesky.h"
#include "base/vec.h"
#include "joint/constants.h"
#include "kernels/kernels.h"

enum { BLOCK = EITS_JOINT_BLOCK, MAX_PARAMETERS = EITS_JOINT_PARAMETERS };

/* ---- F and its normal equations ---- */

static const eits_poles DISCS = {.orders = 3, .sent = 2}, ELLIPSES = {.orders = 5, .sent = 3};

/* Discs need fewer orders; where a single shape is none, all have those of ellipses. */
const eits_poles *eits_joint_poles(const eits_joint *j)
{
    int round = j->parameters == EITS_JOINT_DISC;
    for (uint32_t k = 0; k < j->count; ++k)
        round &= j->shape[k].e1 == 0 && j->shape[k].e2 == 0;
    return round ? &DISCS : &ELLIPSES;
}

/* Sums over blocks of folds. */
typedef struct sums {
    eits_real square;                      /* of what is left */
    eits_real along[EITS_JOINT_NUISANCES]; /* its products with what no touch causes */
} sums;

static eits_real *along_of(eits_context *ctx, uint32_t a)
{
    return ctx->joint.along + (size_t)EITS_JOINT_NUISANCES * a;
}

/* A product of two columns' sums with what no touch causes: mostly the gain's drift alone. */
static eits_real product(const eits_context *ctx, const eits_real *a, const eits_real *b)
{
    return ctx->joint.errors == 0 ? a[0] * b[0]
                                  : eits_dot(ctx->kernels, a, b, 1u + ctx->joint.errors);
}

/* The weighed columns of one block, into the normal equations. */
static void add_columns(eits_context *ctx, uint32_t n, uint32_t first, uint32_t count,
                        const eits_real *left)
{
    eits_joint_memory *m = &ctx->joint;
    const eits_real *weight = m->weight + first;
    for (uint32_t a = 0; a < n; ++a) {
        eits_real *column = m->column + (size_t)BLOCK * a, *row = eits_lower_row(m->normal, a);
        for (uint32_t i = 0; i < count; ++i)
            column[i] *= weight[i];
        m->gradient[a] += eits_dot(ctx->kernels, column, left, count);
        for (uint32_t b = 0; b <= a; ++b)
            row[b] += eits_dot(ctx->kernels, column, m->column + (size_t)BLOCK * b, count);
    }
    eits_joint_add_along(ctx, m->column, n, first, count, m->along);
}

/* Whether some shapes are held (eits_joint_hold). */
static int holds(const eits_joint *j)
{
    return j->free_count < j->count;
}

/* What the free shapes leave of one block, weighed, and their columns into the normal equations,
 * behind them the answers of `further` discs. */
static uint64_t add_block(eits_context *ctx, const eits_joint *j, int slopes, uint32_t further,
                          uint32_t first, uint32_t count, sums *s)
{
    eits_joint_memory *m = &ctx->joint;
    eits_real value[BLOCK], left[BLOCK];
    uint64_t macs = 4u * (uint64_t)count;
    eits_copy(left, (holds(j) ? m->rest : ctx->frame.d) + first, count);
    for (uint32_t free = 0; free < j->free_count; ++free) {
        const uint32_t k = j->free[free];
        eits_pole_out out = {.value = value};
        for (uint32_t p = 0; slopes && p < j->parameters; ++p)
            out.slope[p] = m->column + (size_t)BLOCK * (free * j->parameters + p);
        macs += eits_pole_rows(ctx, k, &j->shape[k], eits_joint_poles(j), first, count, &out);
        for (uint32_t i = 0; slopes && i < count; ++i) /* of log |q| */
            out.slope[3][i] *= j->shape[k].amplitude;
        for (uint32_t i = 0; i < count; ++i)
            left[i] -= value[i];
    }
    for (uint32_t i = 0; i < count; ++i)
        left[i] *= m->weight[first + i];
    s->square += eits_dot(ctx->kernels, left, left, count);
    eits_joint_add_along(ctx, left, 1, first, count, s->along);
    uint32_t n = slopes ? j->free_count * j->parameters : 0;
    for (uint32_t k = j->count; k < j->count + further; ++k) {
        const eits_pole_out out = {.value = m->column + (size_t)BLOCK * n++};
        macs += eits_pole_rows(ctx, k, &j->shape[k], &DISCS, first, count, &out);
    }
    add_columns(ctx, n, first, count, left);
    return macs + (uint64_t)n * (n + 7u + 2u * m->errors) / 2u * count;
}

/* Whether shape k is one of the free ones. */
static int is_free(const eits_joint *j, uint32_t k)
{
    int is = 0;
    for (uint32_t i = 0; i < j->free_count; ++i)
        is |= j->free[i] == k;
    return is;
}

uint64_t eits_joint_hold(eits_context *ctx, const eits_joint *j, uint32_t rounds)
{
    eits_real value[BLOCK], *rest = ctx->joint.rest;
    const uint32_t folds = ctx->model->n_folded;
    uint64_t macs = 0;
    for (uint32_t k = 0; k < j->count && rounds > 0; ++k)
        macs += eits_pole_home(ctx, k, &j->shape[k]);
    macs += eits_pole_induced(ctx, j->shape, j->count, &ELLIPSES, rounds);
    eits_copy(rest, ctx->frame.d, folds);
    for (uint32_t first = 0; first < folds; first += BLOCK) {
        const uint32_t count = folds - first < BLOCK ? folds - first : BLOCK;
        for (uint32_t k = 0; k < j->count; ++k) {
            const eits_pole_out out = {.value = value};
            if (is_free(j, k))
                continue;
            macs += eits_pole_rows(ctx, k, &j->shape[k], eits_joint_poles(j), first, count, &out);
            for (uint32_t i = 0; i < count; ++i)
                rest[first + i] -= value[i];
        }
    }
    return macs;
}

uint64_t eits_joint_restore(eits_context *ctx, const eits_joint *j, uint32_t k)
{
    const uint64_t macs = eits_pole_home(ctx, k, &j->shape[k]);
    eits_pole_lift(ctx, k);
    return macs + eits_pole_induced_in(ctx, j->shape, j->count, &k, 1, &ELLIPSES, 2);
}

/* What no touch causes out of the normal equations, and the priors into them. */
static void finish_normal(eits_context *ctx, const eits_joint *j, uint32_t further, const sums *s)
{
    eits_joint_memory *m = &ctx->joint;
    const uint32_t n = j->free_count * j->parameters;
    for (uint32_t a = 0; a < n + further; ++a) {
        const uint32_t p = a < n ? a % j->parameters : 0; /* further discs have no prior */
        const eits_shape *shape = &j->shape[a < n ? j->free[a / j->parameters] : 0];
        const eits_real prior = eits_joint_precision(shape, p);
        eits_real *row = eits_lower_row(m->normal, a), *along = along_of(ctx, a);
        eits_joint_finish_along(ctx, along);
        m->gradient[a] -= product(ctx, along, s->along);
        m->gradient[a] = eits_fma(-prior, eits_joint_offset(ctx, shape, p), m->gradient[a]);
        for (uint32_t b = 0; b <= a; ++b)
            row[b] -= product(ctx, along, along_of(ctx, b));
        row[a] += prior;
    }
    m->is_known = 0;
}

/* The polynomial of shape k's field; a shape that would reach beyond the rim is made as small as it
 * has to be, of the same strength: its multipoles and their images do not converge otherwise. */
static uint64_t bring_home(eits_context *ctx, uint32_t k, eits_shape *s)
{
    const uint64_t macs = eits_pole_home(ctx, k, s);
    const eits_real room = eits_pole_room(ctx, k, s);
    if (s->radius > room) {
        const eits_real larger = s->radius / room;
        s->amplitude = eits_clamp(s->amplitude * larger * larger, -EITS_JOINT_MAX_AMPLITUDE,
                                  EITS_JOINT_MAX_AMPLITUDE);
        s->radius = room;
    }
    return macs;
}

/* F, and with `slopes` its normal equations. */
static uint64_t evaluate(eits_context *ctx, eits_joint *j, uint32_t rounds, int slopes,
                         uint32_t further)
{
    eits_joint_memory *m = &ctx->joint;
    const uint32_t folds = ctx->model->n_folded,
                   n = (slopes ? j->free_count * j->parameters : 0) + further;
    sums s;
    s.square = 0;
    eits_zero(s.along, 1u + m->errors);
    uint64_t macs = 0;
    for (uint32_t k = 0; k < j->free_count && rounds > 0; ++k)
        macs += bring_home(ctx, j->free[k], &j->shape[j->free[k]]);
    macs += eits_pole_induced_in(ctx, j->shape, j->count, j->free, j->free_count,
                                 eits_joint_poles(j), rounds);
    eits_zero(m->normal, EITS_LOWER_SIZE(n));
    eits_zero(m->gradient, n);
    for (uint32_t a = 0; a < n; ++a)
        eits_zero(along_of(ctx, a), 1u + m->errors);
    for (uint32_t first = 0; first < folds; first += BLOCK) {
        const uint32_t count = folds - first < BLOCK ? folds - first : BLOCK;
        macs += add_block(ctx, j, slopes, further, first, count, &s);
    }
    eits_joint_finish_along(ctx, s.along);
    j->misfit = s.square - product(ctx, s.along, s.along);
    j->cost = j->misfit + eits_joint_priors(ctx, j);
    if (slopes) {
        finish_normal(ctx, j, further, &s);
        m->evaluated = macs;
    }
    return macs;
}

uint64_t eits_joint_evaluate(eits_context *ctx, eits_joint *j, uint32_t rounds)
{
    return evaluate(ctx, j, rounds, 1, 0);
}

/* ---- steps ---- */

/* The normal matrix, its diagonal raised by `damping`, becomes L L' in m->factor. A pivot that is
 * rounding, of two touches in one place, is held up: the step along it is short, not infinite. */
static void factor(eits_context *ctx, uint32_t n, eits_real damping)
{
    eits_joint_memory *m = &ctx->joint;
    eits_copy(m->factor, m->normal, EITS_LOWER_SIZE(n));
    for (uint32_t i = 0; i < n; ++i) {
        eits_real *row = eits_lower_row(m->factor, i);
        const eits_real least = EITS_JOINT_MIN_PIVOT * row[i];
        row[i] *= 1 + damping;
        row[i] = eits_sqrt(eits_larger(eits_cholesky_row(m->factor, i), least));
    }
}

static void solve(eits_context *ctx, uint32_t n, eits_real *v)
{
    eits_lower_solve(ctx->joint.factor, n, v);
    eits_lower_solve_transposed(ctx->joint.factor, n, v);
}

/* e^step, up to the third order of a step that is small. */
static eits_real growth(eits_real step)
{
    return eits_fma(step, eits_fma(R(0.5), step, 1), 1);
}

/* The shapes a step further. One that would leave the skin stays where it is; its other parameters
 * move. */
static eits_joint moved(const eits_context *ctx, const eits_joint *from, const eits_real *step)
{
    static const eits_real most[EITS_JOINT_ELLIPSE] = {EITS_JOINT_MAX_MOVE,   EITS_JOINT_MAX_MOVE,
                                                       EITS_JOINT_MAX_GROWTH, EITS_JOINT_MAX_GAIN,
                                                       EITS_JOINT_MAX_SHAPE,  EITS_JOINT_MAX_SHAPE};
    eits_real over = 1;
    eits_joint to = *from;
    for (uint32_t a = 0; a < from->free_count * from->parameters; ++a)
        over = eits_larger(over, eits_fabs(step[a]) / most[a % from->parameters]);
    for (uint32_t i = 0; i < from->free_count; ++i) {
        const eits_real *s = step + i * from->parameters, part = 1 / over;
        eits_shape *shape = &to.shape[from->free[i]];
        const eits_real x = eits_fma(part, s[0], shape->x), y = eits_fma(part, s[1], shape->y);
        if (eits_pole_on_skin(ctx, x, y)) {
            shape->x = x;
            shape->y = y;
        }
        shape->radius *= growth(part * s[2]);
        shape->amplitude = eits_clamp(growth(part * s[3]) * shape->amplitude,
                                      -EITS_JOINT_MAX_AMPLITUDE, EITS_JOINT_MAX_AMPLITUDE);
        if (from->parameters == EITS_JOINT_ELLIPSE) {
            shape->e1 = eits_clamp(eits_fma(part, s[4], shape->e1), -EITS_JOINT_MAX_ETA,
                                   EITS_JOINT_MAX_ETA);
            shape->e2 = eits_clamp(eits_fma(part, s[5], shape->e2), -EITS_JOINT_MAX_ETA,
                                   EITS_JOINT_MAX_ETA);
        }
    }
    return to;
}

eits_real eits_joint_expect(eits_context *ctx, eits_joint *j, uint64_t *macs)
{
    const uint32_t n = j->free_count * j->parameters;
    eits_real d[MAX_PARAMETERS];
    for (uint32_t k = 0; k < j->free_count; ++k)
        eits_pole_lift(ctx, j->free[k]);
    *macs += eits_joint_evaluate(ctx, j, 2) + (uint64_t)n * n * (n + 6u) / 6u;
    factor(ctx, n, EITS_JOINT_DAMPING);
    eits_copy(d, ctx->joint.gradient, n);
    solve(ctx, n, d);
    return j->cost - eits_dot(ctx->kernels, ctx->joint.gradient, d, n);
}

uint64_t eits_joint_score(eits_context *ctx, eits_joint *j, uint32_t further, eits_real *gain,
                          eits_real *scale)
{
    const uint32_t n = j->count * j->parameters;
    eits_real by[MAX_PARAMETERS], step[MAX_PARAMETERS];
    uint64_t macs = 0;
    for (uint32_t k = j->count; k < j->count + further; ++k) {
        macs += bring_home(ctx, k, &j->shape[k]);
        eits_pole_lift(ctx, k);
    }
    macs += evaluate(ctx, j, 1, 1, further);
    factor(ctx, n, 0);
    eits_copy(step, ctx->joint.gradient, n);
    eits_lower_solve(ctx->joint.factor, n, step);
    for (uint32_t i = 0; i < further; ++i) {
        const eits_real *row = eits_lower_row(ctx->joint.normal, n + i);
        eits_copy(by, row, n);
        eits_lower_solve(ctx->joint.factor, n, by);
        const eits_real own = row[n + i] - eits_dot(ctx->kernels, by, by, n),
                        answer = ctx->joint.gradient[n + i] - eits_dot(ctx->kernels, by, step, n);
        const int explains = answer > 0 && own > EITS_JOINT_MIN_PIVOT * row[n + i];
        gain[i] = explains ? answer * answer / own : 0;
        scale[i] = explains ? answer / own : 0;
    }
    return macs + (uint64_t)n * n * (n / 6u + further);
}

void eits_joint_keep(eits_context *ctx, const eits_joint *j)
{
    eits_copy(ctx->joint.kept, ctx->joint.normal, EITS_LOWER_SIZE(j->count * j->parameters));
}

void eits_joint_back(eits_context *ctx, const eits_joint *j)
{
    eits_copy(ctx->joint.normal, ctx->joint.kept, EITS_LOWER_SIZE(j->count * j->parameters));
    ctx->joint.is_known = 0;
}

uint64_t eits_joint_return_to(eits_context *ctx, eits_joint *j)
{
    eits_pole_clear(ctx, j->count);
    eits_joint_free_all(j);
    return eits_joint_evaluate(ctx, j, EITS_JOINT_ROUNDS);
}

uint64_t eits_joint_limit(const eits_context *ctx, const eits_joint *j, uint64_t most)
{
    const uint64_t all = eits_fit_limit(ctx, j->searches ? EITS_FIRST_WORK : EITS_TOUCH_WORK);
    return most < all ? most : all;
}

void eits_joint_descend(eits_context *ctx, eits_joint *j, uint32_t rounds, eits_real hopeless,
                        uint64_t *macs)
{
    *macs += eits_joint_evaluate(ctx, j, rounds);
    eits_joint_continue(ctx, j, hopeless, macs);
}

void eits_joint_continue(eits_context *ctx, eits_joint *j, eits_real hopeless, uint64_t *macs)
{
    const uint32_t n = j->free_count * j->parameters;
    eits_real damping = EITS_JOINT_DAMPING;
    for (uint32_t step = 0; step < EITS_JOINT_STEPS; ++step) {
        eits_real d[MAX_PARAMETERS];
        factor(ctx, n, damping);
        eits_copy(d, ctx->joint.gradient, n);
        solve(ctx, n, d);
        const eits_real predicted = eits_dot(ctx->kernels, ctx->joint.gradient, d, n);
        if (!(predicted > EITS_JOINT_SETTLED) ||
            !(j->misfit < EITS_JOINT_WORSE * ctx->joint.energy) ||
            (predicted < EITS_JOINT_HOPEFUL * j->cost && j->cost - predicted > hopeless) ||
            *macs > (j->misfit < EITS_JOINT_CLOSE * ctx->joint.energy ? j->further : j->most))
            return;
        eits_joint trial = moved(ctx, j, d);
        *macs += evaluate(ctx, &trial, 1, 0, 0) + (uint64_t)n * n * (n + 6u) / 6u;
        const eits_real fallen = j->cost - trial.cost;
        if (fallen > 0) {
            *j = trial;
            ctx->joint.is_known = 0;
            damping *= EITS_JOINT_DAMP_LESS;
            if (eits_fabs(predicted - fallen) < EITS_JOINT_AS_PREDICTED * eits_joint_excess(ctx, j))
                return;
            *macs += evaluate(ctx, j, 0, 1, 0);
        } else /* again, a shorter step */
            damping = eits_larger(EITS_JOINT_DAMP_MORE * damping, EITS_JOINT_DAMPED);
    }
}

/* Note the step and the rise of F if the prior of log |amplitude| became that of the other kind:
 * the normal equations change from A to A + D e e' and the gradient from 0 to g e, so that the step
 * is g A^-1 e / (1 + D e'A^-1 e). */
static void know_other(const eits_shape *shape, const eits_real *block, eits_joint_known *known)
{
    const eits_real *amplitude = block + EITS_LOWER_SIZE(3); /* row 3 of A^-1 */
    eits_joint_change c;
    eits_joint_other_prior(shape, &c);
    const eits_real far =
        c.gradient / eits_larger(eits_fma(c.precision, amplitude[3], 1), EITS_JOINT_MIN_PIVOT);
    known->other_rise = c.cost - c.gradient * far * amplitude[3];
    for (uint32_t i = 0; i < 3; ++i)
        known->other_step[i] = far * amplitude[i];
}

/* By the block of A^-1 of one shape's parameters: its inverse is what all others leave of A. */
static void know(const eits_joint *j, uint32_t k, eits_real *block, eits_joint_known *known)
{
    const uint32_t amplitude = 3, p = j->parameters;
    eits_real unit[EITS_JOINT_ELLIPSE] = {0};
    known->place[0] = eits_lower_row(block, 0)[0];
    known->place[1] = eits_lower_row(block, 1)[0];
    known->place[2] = eits_lower_row(block, 1)[1];
    known->log_radius = eits_lower_row(block, 2)[2];
    know_other(&j->shape[k], block, known);
    known->shape = 0;
    for (uint32_t i = EITS_JOINT_DISC; i < p; ++i) {
        const eits_real e = i == EITS_JOINT_DISC ? j->shape[k].e1 : j->shape[k].e2;
        known->shape = eits_fma(e / eits_lower_row(block, i)[i], e, known->shape);
    }
    for (uint32_t i = 0; i < p; ++i) {
        eits_real *row = eits_lower_row(block, i);
        const eits_real least = EITS_JOINT_MIN_PIVOT * row[i];
        row[i] = eits_sqrt(eits_larger(eits_cholesky_row(block, i), least));
    }
    unit[amplitude] = 1;
    eits_lower_solve(block, p, unit);
    eits_lower_solve_transposed(block, p, unit);
    /* a prior is no evidence */
    known->rise = unit[amplitude] - eits_joint_precision(&j->shape[k], amplitude);
}

const eits_joint_known *eits_joint_places(eits_context *ctx, const eits_joint *j, uint64_t *macs)
{
    const uint32_t p = j->parameters, n = j->count * p;
    eits_joint_known *known = ctx->joint.known;
    if (ctx->joint.is_known)
        return known;
    factor(ctx, n, 0);
    for (uint32_t k = 0; k < j->count; ++k) {
        eits_real block[EITS_LOWER_SIZE(EITS_JOINT_ELLIPSE)];
        for (uint32_t i = 0; i < p; ++i) {
            eits_real column[MAX_PARAMETERS];
            eits_lower_inverse(ctx->joint.factor, n, k * p, k * p + i + 1u, column);
            for (uint32_t l = 0; l <= i; ++l)
                eits_lower_row(block, i)[l] = column[k * p + l];
        }
        know(j, k, block, &known[k]);
    }
    ctx->joint.is_known = 1;
    *macs += (uint64_t)n * n * n / 2u;
    return known;
}

/* The normal equations of a hypothesis: what a step promises, the step, and how sure its numbers
 * are.
 */
#include "search/search.h"

uint32_t eits_trial_numbers(const fast_trial *trial)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < trial->bodies; ++i)
        count += trial->body[i].numbers;
    return count;
}

/* The factor of h with a unit diagonal, `damping` added to it: millimetres and speeds of unlike
 * strengths differ by orders of magnitude, and a limit on pivots means something only between
 * numbers of one size. 0 where h is not well above zero, or no number. */
static int factorise(const fast_trial *trial, eits_real damping, eits_real *factor,
                     eits_real *scale)
{
    const uint32_t n = eits_trial_numbers(trial);
    for (uint32_t i = 0; i < n; ++i) {
        const eits_real *h = trial->h + (size_t)i * (i + 1) / 2;
        eits_real *line = fast_line(factor, i);
        if (!(h[i] > 0))
            return 0;
        scale[i] = 1 / eits_sqrt(h[i]);
        for (uint32_t j = 0; j < i; ++j)
            line[j] = h[j] * scale[i] * scale[j];
        const eits_real pivot = fast_factor_row(factor, i, 1 + damping);
        if (!(pivot > EITS_FAST_SINGULAR))
            return 0;
        line[i] = eits_sqrt(pivot);
    }
    return 1;
}

eits_real eits_trial_promise(const fast_trial *trial)
{
    eits_real factor[FAST_TRIANGLE], scale[FAST_FIT], x[FAST_FIT];
    const uint32_t n = eits_trial_numbers(trial);
    if (!factorise(trial, 0, factor, scale))
        return 0;
    for (uint32_t i = 0; i < n; ++i)
        x[i] = trial->b[i] * scale[i];
    fast_whiten(factor, x, n);
    return fast_dot(x, x, n);
}

int eits_trial_covariance(const fast_trial *trial, eits_real covariance[FAST_FIT][FAST_FIT])
{
    eits_real factor[FAST_TRIANGLE], scale[FAST_FIT], half[FAST_FIT][FAST_FIT];
    const uint32_t n = eits_trial_numbers(trial);
    if (!factorise(trial, 0, factor, scale))
        return 0;
    for (uint32_t i = 0; i < n; ++i) {
        eits_zero(half[i], n);
        half[i][i] = scale[i];
        fast_whiten(factor, half[i], n);
    }
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t j = 0; j < n; ++j)
            covariance[i][j] = fast_dot(half[i], half[j], n);
    }
    return 1;
}

eits_real eits_trial_step(const fast_trial *trial, eits_real shorter, eits_real *step)
{
    eits_real factor[FAST_TRIANGLE], scale[FAST_FIT], length = 0;
    const uint32_t n = eits_trial_numbers(trial);
    if (!factorise(trial, EITS_FAST_DAMPING, factor, scale))
        return -1;
    for (uint32_t i = 0; i < n; ++i)
        step[i] = trial->b[i] * scale[i];
    fast_whiten(factor, step, n);
    for (uint32_t i = n; i-- > 0;) {
        const eits_real *line = fast_line(factor, i);
        step[i] /= line[i];
        fast_axpy(step, -step[i], line, i);
    }
    for (uint32_t i = 0, at = 0; i < trial->bodies; at += trial->body[i++].numbers) {
        for (uint32_t k = 0; k < trial->body[i].numbers; ++k)
            step[at + k] *= shorter * scale[at + k];
        length = eits_larger(length, eits_larger(eits_fabs(step[at]), eits_fabs(step[at + 1])));
    }
    if (!(length > EITS_FAST_MAX_STEP_MM))
        return length;
    for (uint32_t i = 0; i < n; ++i)
        step[i] *= EITS_FAST_MAX_STEP_MM / length;
    return EITS_FAST_MAX_STEP_MM;
}

/* Rows less what has been fitted to them, at least 1. */
static eits_real freedom(const eits_fast *fast, const fast_trial *trial, uint32_t fresh)
{
    const uint32_t spent = fresh * (trial->count + 2u);
    uint32_t rows = 0;
    for (uint32_t n = 0; n < trial->count; ++n)
        rows += search_drive(fast, trial, n)->rows;
    return rows > spent ? (eits_real)(rows - spent) : R(1);
}

eits_real eits_doubt(const eits_fast *fast, const fast_trial *trial)
{
    const eits_real each = trial->left / freedom(fast, trial, trial->fresh);
    return each > 1 ? each : 1;
}

/* Whether the trial leaves hardly more than noise does, whose mean is the freedom and whose
 * variance is twice that. A touch that is no disc may also leave `part` of what it explains. */
static int leaves_noise(const eits_fast *fast, const fast_trial *trial, uint32_t fresh,
                        eits_real part)
{
    const eits_real free = freedom(fast, trial, fresh);
    const eits_real gain = trial->all - trial->left;
    return trial->left < free + EITS_FAST_LEFT_SD * eits_sqrt(2 * free) +
                             fast_square(part) * (gain > 0 ? gain : 0);
}

int eits_is_noise(const eits_fast *fast, const fast_trial *trial, uint32_t fresh)
{
    return leaves_noise(fast, trial, fresh, EITS_FAST_BIRTH_ERROR);
}

int eits_is_clear(const eits_fast *fast, const fast_trial *trial, uint32_t fresh)
{
    return leaves_noise(fast, trial, fresh, EITS_FAST_CLEAR_ERROR);
}

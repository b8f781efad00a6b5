/* This file predicts a drive's rows from the known touches, and learns the model's error there.
 *
 * A still touch leaves more than noise, the same in each scan: the model's error. It is learned row
 * by row while all is quiet, and serves as far as the touches still give what they gave then: its
 * part is the share q of what they give now along what they gave. The rest is uncertain: of what is
 * new a fixed fraction in its own row, and a smaller one of its rms in each. */
#include "fast/fast.h"

/* Answers of all known touches with what the others do to them: the derivative by one strength has
 * the interplay with each other touch once, so the sum over touches has each pair twice. */
static void answer_all(eits_fast *fast, uint32_t drive)
{
    const size_t size = FAST_WAYS * (size_t)fast->most_rows;
    const uint32_t rows = fast->drive[drive].count;
    eits_zero(fast->twice, rows);
    for (uint32_t k = 0; k < fast->count; ++k) {
        const eits_real *state = fast->state + FAST_SIZE * k;
        fast_disc *disc = &fast->search.disc[0];
        if (!eits_fast_gather(fast, state, fast->known[k].rho2, disc)) {
            eits_zero(fast->answer + size * k, size);
            continue;
        }
        eits_fast_answer(fast, drive, disc, fast->answer + size * k);
        if (fast->count > 1)
            eits_fast_look(fast, state, fast->known[k].rho2, disc, &fast->sight[k]);
    }
    for (uint32_t k = 1; k < fast->count; ++k) {
        for (uint32_t l = 0; l < k; ++l) {
            const eits_real c_k = fast->state[FAST_SIZE * k + FAST_C];
            const eits_real c_l = fast->state[FAST_SIZE * l + FAST_C];
            eits_zero(fast->spare, rows);
            eits_fast_add_interplay(fast, drive, &fast->sight[k], &fast->sight[l], 1, fast->spare);
            fast_axpy(fast->answer + size * k, c_l, fast->spare, rows);
            fast_axpy(fast->answer + size * l, c_k, fast->spare, rows);
            fast_axpy(fast->twice, c_k * c_l, fast->spare, rows);
        }
    }
}

static void learned_error(eits_fast *fast, const fast_drive *d)
{
    const uint32_t rows = d->count;
    const eits_real *then = fast->bias_h + d->first;
    eits_real *beyond = fast->spare;
    const eits_real energy = fast_dot(then, then, rows);
    eits_real q = energy > 0 ? fast_dot(fast->h, then, rows) / energy : 0;
    q = q < 0 ? 0 : q > EITS_FAST_BIAS_MOST ? EITS_FAST_BIAS_MOST : q;
    eits_copy(beyond, fast->h, rows);
    fast_axpy(beyond, -q, then, rows);
    const eits_real all =
        fast_square(EITS_FAST_DRIVE_ERROR) * fast_dot(beyond, beyond, rows) / (eits_real)rows;
    for (uint32_t i = 0; i < rows; ++i) {
        const eits_real bias = fast->bias[d->first + i];
        fast->learned[i] = q * bias;
        fast->error[i] = q * q * fast->bias_variance[d->first + i] +
                         fast_square(EITS_FAST_MODEL_ERROR * beyond[i]) + all +
                         fast_square(EITS_FAST_BIAS_OLD * (1 - q) * bias);
    }
}

void eits_fast_expect(eits_fast *fast, uint32_t drive)
{
    const fast_drive *d = &fast->drive[drive];
    const size_t size = FAST_WAYS * (size_t)fast->most_rows;
    eits_zero(fast->h, d->count);
    if (fast->count == 0) { /* nothing is expected, and no error learned */
        eits_zero(fast->learned, d->count);
        eits_zero(fast->error, d->count);
        return;
    }
    answer_all(fast, drive);
    for (uint32_t k = 0; k < fast->count; ++k)
        fast_axpy(fast->h, fast->state[FAST_SIZE * k + FAST_C], fast->answer + size * k, d->count);
    fast_axpy(fast->h, -1, fast->twice, d->count);
    learned_error(fast, d);
}

static uint32_t bits_of(uint32_t bits)
{
    uint32_t count = 0;
    for (; bits != 0; bits &= bits - 1)
        ++count;
    return count;
}

/* chi^2 of what has changed since the rows' last news, with the noise of both. */
static eits_real changed(eits_fast *fast, const fast_drive *d)
{
    eits_real *factor = fast->other_factor, *change = fast->spare;
    for (uint32_t i = 0; i < d->count; ++i) {
        eits_real *line = fast_line(factor, i);
        /* S again from its own factor: it is not kept beside it */
        for (uint32_t j = 0; j <= i; ++j)
            line[j] = fast_dot(fast_line(fast->factor, i), fast_line(fast->factor, j), j + 1);
        const eits_real pivot = fast_factor_row(factor, i, line[i] + fast_square(fast->sigma));
        line[i] = eits_sqrt(pivot > 0 ? pivot : fast_square(fast->sigma));
        change[i] = fast->used[i] ? fast->e[i] - fast->rest[d->first + i] : 0;
    }
    fast_whiten(factor, change, d->count);
    return fast_dot(change, change, d->count);
}

int eits_fast_is_known_error(eits_fast *fast, uint32_t drive, eits_real chi2)
{
    fast_drive *d = &fast->drive[drive];
    const uint32_t scan = fast->drives + 1, news = bits_of(fast->newsy & 0xffffu);
    const int again =
        d->rest_at > 0 && fast->drive_count - d->rest_at <= scan && news <= EITS_FAST_FEW_NEWS;
    const eits_real tenth = EITS_FAST_SAME_REST * chi2;
    const int same = again && changed(fast, d) < eits_larger(EITS_FAST_NEWS, tenth);
    eits_copy(fast->rest + d->first, fast->e, d->count);
    d->rest_at = fast->drive_count;
    for (uint32_t i = 0; same && i < d->count; ++i) {
        fast->bias[d->first + i] = fast->learned[i] + fast->e[i];
        fast->bias_variance[d->first + i] =
            fast_square(fast->sigma) + fast_square(EITS_FAST_SAME_REST * fast->e[i]);
        fast->bias_h[d->first + i] = fast->h[i];
    }
    d->learned |= (uint8_t)same;
    return same;
}

/* R of a row: its noise and the model's error that is not known. */
static eits_real row_variance(const eits_fast *fast, uint32_t i)
{
    return fast_square(fast->sigma) + fast->error[i];
}

void eits_fast_learn(eits_fast *fast, uint32_t drive)
{
    fast_drive *d = &fast->drive[drive];
    eits_real *left = fast->spare;
    d->learned = 1;
    /* An update leaves R S^-1 e of the rows. */
    eits_copy(left, fast->white, d->count);
    for (uint32_t i = d->count; i-- > 0;) {
        const eits_real *line = fast_line(fast->factor, i);
        left[i] /= line[i];
        fast_axpy(left, -left[i], line, i);
    }
    /* The learned error is stored with the answer that was expected before the update (bias_h). If
     * it were stored with the answer that is expected after it, a drive that takes strength from a
     * touch would raise its error in each scan. */
    for (uint32_t i = 0; i < d->count; ++i) {
        const eits_real error = fast->error[i], noise = fast_square(fast->sigma);
        const eits_real share = eits_larger(EITS_FAST_BIAS_LEAST, error / (error + noise));
        if (!fast->used[i])
            continue;
        fast->bias[d->first + i] = fast->learned[i] + share * row_variance(fast, i) * left[i];
        fast->bias_variance[d->first + i] =
            fast_square(1 - share) * error + fast_square(share) * noise;
        fast->bias_h[d->first + i] = fast->h[i];
    }
}

void eits_fast_forget_errors(eits_fast *fast, uint32_t drive)
{
    fast_drive *d = &fast->drive[drive];
    if (!d->learned)
        return;
    d->learned = 0;
    eits_zero(fast->bias + d->first, d->count);
    eits_zero(fast->bias_variance + d->first, d->count);
    eits_zero(fast->bias_h + d->first, d->count);
}

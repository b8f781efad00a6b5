/* New touches by a matched filter over the drives that wait for an explanation.
 *
 * Each drive has a strength of its own, since a touch that lands grows from drive to drive; only
 * the place is common. So strengths are solved for at each place, and only places are stepped
 * (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413). Rows are whitened
 * by what known touches may still do. The map over cells grows by one drive at a time; its peaks
 * start damped Gauss-Newton steps, of which there are the fewer the more drives wait. */
#include "fast/fast.h"

/* Scaled to a unit diagonal first: millimetres of two touches of unlike strength differ by orders
 * of magnitude, and a limit on pivots means something only between numbers of one size. Cholesky
 * then finds a matrix that is not positive by a root that fails, which also catches a NaN. */
int eits_fast_invert(const eits_real h[4][4], uint32_t n, eits_real inverse[4][4])
{
    eits_real scale[4], factor[10], half[4][4];
    for (uint32_t i = 0; i < n; ++i) {
        if (!(h[i][i] > 0))
            return 0;
        scale[i] = 1 / eits_sqrt(h[i][i]);
    }
    for (uint32_t i = 0; i < n; ++i) {
        eits_real *line = fast_line(factor, i);
        for (uint32_t j = 0; j < i; ++j)
            line[j] = h[i][j] * scale[i] * scale[j];
        line[i] = eits_sqrt(fast_factor_row(factor, i, h[i][i] * scale[i] * scale[i]));
        if (!(fast_square(line[i]) > EITS_FAST_SINGULAR)) /* false for NaN */
            return 0;
    }
    for (uint32_t i = 0; i < n; ++i) {
        eits_zero(half[i], n);
        half[i][i] = scale[i];
        fast_whiten(factor, half[i], n);
    }
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t j = 0; j < n; ++j)
            inverse[i][j] = fast_dot(half[i], half[j], n);
    }
    return 1;
}

/* Least squares of `white` by one or two answers, none of the wrong sign. */
static void solve_strengths(const eits_fast *fast, const eits_real *const g[2], uint32_t count,
                            const eits_real *white, uint32_t rows, eits_real *strength)
{
    eits_real gram[2], toward[2], alone[2];
    for (uint32_t i = 0; i < count; ++i) {
        gram[i] = fast_dot(g[i], g[i], rows);
        toward[i] = fast->sign * fast_dot(g[i], white, rows);
        alone[i] = gram[i] > 0 && toward[i] > 0 ? toward[i] / gram[i] : 0;
        strength[i] = fast->sign * alone[i];
    }
    if (count == 1)
        return;
    /* Both of the right sign: the usual two by two system. Otherwise the best answer lies on the
     * border, where the better of the two stands alone; a touch of the wrong sign would let two
     * near places cancel each other and explain any noise. */
    const eits_real cross = fast_dot(g[0], g[1], rows), both = gram[0] * gram[1];
    const eits_real det = both - cross * cross;
    const eits_real first = gram[1] * toward[0] - cross * toward[1];
    const eits_real second = gram[0] * toward[1] - cross * toward[0];
    if (det > EITS_FAST_SINGULAR * both && first >= 0 && second >= 0) {
        strength[0] = fast->sign * first / det;
        strength[1] = fast->sign * second / det;
    } else {
        strength[alone[0] * toward[0] < alone[1] * toward[1] ? 0 : 1] = 0;
    }
}

/* An answer and its derivatives, each L^-1 of it. Without known touches L is a diagonal. */
static void whiten_ways(const fast_held *held, eits_real *answer, size_t stride, uint32_t rows)
{
    eits_real *v[FAST_WAYS] = {answer, answer + stride, answer + 2 * stride};
    for (uint32_t i = 0; i < rows; ++i) {
        const eits_real *line = fast_line(held->factor, i);
        eits_real sum[FAST_WAYS] = {0, 0, 0};
        for (uint32_t j = held->alone ? i : 0; j < i; ++j) {
            for (uint32_t way = 0; way < FAST_WAYS; ++way)
                sum[way] += line[j] * v[way][j];
        }
        for (uint32_t way = 0; way < FAST_WAYS; ++way)
            v[way][i] = (v[way][i] - sum[way]) / line[i];
    }
}

/* Answers become an orthonormal basis, those of a touch without strength aside; how many. */
static uint32_t make_basis(fast_share *share, uint32_t count, eits_real *const answer[2],
                           uint32_t rows, const eits_real *unit[2])
{
    uint32_t basis = 0;
    for (uint32_t i = 0; i < count; ++i) {
        share->variance[i] = 0;
        if (share->strength[i] == 0)
            continue;
        for (uint32_t q = 0; q < basis; ++q)
            fast_axpy(answer[i], -fast_dot(unit[q], answer[i], rows), unit[q], rows);
        share->variance[i] = 1 / fast_dot(answer[i], answer[i], rows);
        const eits_real scale = eits_sqrt(share->variance[i]);
        for (uint32_t r = 0; r < rows; ++r)
            answer[i][r] *= scale;
        unit[basis++] = answer[i];
    }
    return basis;
}

/* What a drive says of moving the touches: derivatives less what strengths can do of them.
 * `answer` are the touches' whitened answers, all of which are spent. */
static void say_normal(fast_share *share, uint32_t count, eits_real *const answer[2], size_t stride,
                       const eits_real *rest, uint32_t rows)
{
    const eits_real *unit[2] = {NULL, NULL};
    const uint32_t basis = make_basis(share, count, answer, rows, unit);
    uint32_t at = 0;
    for (uint32_t i = 0; i < 2 * count; ++i) {
        eits_real *slope = answer[i / 2] + (1 + i % 2) * stride;
        for (uint32_t r = 0; r < rows; ++r)
            slope[r] *= share->strength[i / 2];
        for (uint32_t q = 0; q < basis; ++q)
            fast_axpy(slope, -fast_dot(unit[q], slope, rows), unit[q], rows);
        share->b[i] = fast_dot(slope, rest, rows);
        for (uint32_t j = 0; j <= i; ++j)
            share->h[at++] = fast_dot(slope, answer[j / 2] + (1 + j % 2) * stride, rows);
    }
}

/* A place's whitened answer in a drive and its slopes; 0 where it is off the skin. */
static int whitened(eits_fast *fast, const fast_held *held, const eits_real *place, eits_real *out)
{
    if (!eits_fast_answer(fast, held->drive, place, out))
        return 0;
    /* A row that is not in use says nothing of touches: neither that there is one nor none. */
    for (uint32_t i = 0; i < fast->drive[held->drive].count; ++i) {
        for (uint32_t way = 0; way < FAST_WAYS && (held->used >> i & 1u) == 0; ++way)
            out[(size_t)way * fast->most_rows + i] = 0;
    }
    whiten_ways(held, out, fast->most_rows, fast->drive[held->drive].count);
    return 1;
}

/* What one drive says of a fit; 0 where a place is off the skin. `first`: the whitened answer of
 * the first place, NULL where it is not there. */
static int say_drive(eits_fast *fast, const fast_held *held, const fast_fit *fit,
                     const eits_real *first, fast_share *share)
{
    const uint32_t rows = fast->drive[held->drive].count;
    const size_t stride = fast->most_rows;
    eits_real *answer[2] = {fast->answer, fast->answer + FAST_WAYS * stride};
    const eits_real *g[2] = {answer[0], answer[1]};
    eits_real *rest = fast->spare;
    for (uint32_t i = 0; i < fit->count; ++i) {
        if (i == 0 && first != NULL)
            eits_copy(answer[0], first, FAST_WAYS * fast->most_rows);
        else if (!whitened(fast, held, fit->place[i], answer[i]))
            return 0;
    }
    solve_strengths(fast, g, fit->count, held->white, rows, share->strength);
    eits_copy(rest, held->white, rows);
    for (uint32_t i = 0; i < fit->count; ++i)
        fast_axpy(rest, -share->strength[i], g[i], rows);
    const eits_real all = fast_dot(held->white, held->white, rows);
    share->left = fast_dot(rest, rest, rows);
    share->score = all - share->left;
    /* What a touch explains beside the other is the loss when it alone is taken away, with the
     * other free to take over what it can. The sum over drives decides about births. */
    for (uint32_t i = 0; i < fit->count; ++i) {
        eits_real without = all, other = 0;
        if (fit->count == 2) {
            const uint32_t o = 1 - i;
            solve_strengths(fast, &g[o], 1, held->white, rows, &other);
            without +=
                (other * fast_dot(g[o], g[o], rows) - 2 * fast_dot(g[o], held->white, rows)) *
                other;
        }
        share->own[i] = without - share->left;
    }
    say_normal(share, fit->count, answer, stride, rest, rows);
    return 1;
}

/* The sums are made again from all drives, in the order in which they wait: to subtract the share
 * of one that goes would leave rounding that depends on the history. */
static void add_share(fast_fit *fit, const fast_share *share)
{
    uint32_t at = 0;
    fit->left_all += share->left;
    fit->score += share->score;
    for (uint32_t i = 0; i < fit->count; ++i) {
        fit->own[i] += share->own[i];
        fit->variance[i] = share->variance[i];
    }
    for (uint32_t i = 0; i < 2 * fit->count; ++i) {
        fit->b[i] += share->b[i];
        for (uint32_t j = 0; j <= i; ++j) {
            fit->h[i][j] += share->h[at++];
            fit->h[j][i] = fit->h[i][j];
        }
    }
}

/* `first`: whitened answers of the first place in these drives, NULL where they are not there. */
static int fit_beside(eits_fast *fast, uint32_t from, uint32_t known, const eits_real *first,
                      fast_fit *fit)
{
    const size_t stride = FAST_WAYS * (size_t)fast->most_rows;
    for (uint32_t n = from; n < fast->held_count; ++n) {
        const eits_real *here = first == NULL ? NULL : first + stride * (n - from);
        if ((known >> n & 1u) == 0 && !say_drive(fast, &fast->held[n], fit, here, &fit->share[n]))
            return 0;
    }
    fit->left_all = fit->score = fit->own[0] = fit->own[1] = 0;
    eits_zero(fit->b, 4);
    eits_zero(fit->h[0], 16);
    for (uint32_t n = from; n < fast->held_count; ++n)
        add_share(fit, &fit->share[n]);
    return 1;
}

int eits_fast_fit_at(eits_fast *fast, uint32_t from, uint32_t known, fast_fit *fit)
{
    return fit_beside(fast, from, known, NULL, fit);
}

/* Else the next search had to look at all drives that came without news, or while another search
 * ran. Its places are on the skin. */
void eits_fast_keep_up(eits_fast *fast)
{
    fast_held *newest = &fast->held[fast->held_count - 1];
    fast_fit *fit = &fast->trial;
    fit->count = 1;
    for (uint32_t k = 0; k < fast->last_count; ++k) {
        eits_copy(fit->place[0], fast->last[k], 2);
        (void)say_drive(fast, newest, fit, NULL, &newest->share[k]);
        newest->said |= (uint8_t)(1u << k);
    }
}

/* The step that the normal equations ask for, at most EITS_FAST_MAX_STEP_MM along an axis; its
 * length, or below 0 where they are singular. */
static eits_real damped_step(const fast_fit *fit, eits_real shorter, eits_real *step)
{
    const uint32_t n = 2 * fit->count;
    eits_real damped[4][4], inverse[4][4], length = 0;
    memcpy(damped, fit->h, sizeof damped);
    /* In proportion to the diagonal, so that damping means the same near the rim, where answers are
     * many times larger, as in the middle. */
    for (uint32_t i = 0; i < n; ++i)
        damped[i][i] = fit->h[i][i] + EITS_FAST_DAMPING * fit->h[i][i];
    if (!eits_fast_invert((const eits_real(*)[4])damped, n, inverse))
        return -1;
    for (uint32_t i = 0; i < n; ++i) {
        step[i] = shorter * fast_dot(inverse[i], fit->b, n);
        length = eits_larger(eits_fabs(step[i]), length);
    }
    if (!(length > EITS_FAST_MAX_STEP_MM))
        return length;
    for (uint32_t i = 0; i < n; ++i)
        step[i] *= EITS_FAST_MAX_STEP_MM / length;
    return EITS_FAST_MAX_STEP_MM;
}

/* Damped Gauss-Newton steps from fit->place, of which drives in the bits of `known` have said what
 * they do; `beside` as `first` above. 0 where it is off the skin. */
static int refine(eits_fast *fast, uint32_t from, uint32_t steps, uint32_t known,
                  const eits_real *beside, fast_fit *fit)
{
    eits_real shorter = 1, step[4];
    if (!fit_beside(fast, from, known, beside, fit))
        return 0;
    for (; steps > 0; --steps) {
        const eits_real length = damped_step(fit, shorter, step);
        if (length < 0)
            return 1;
        fast_fit *trial = &fast->trial;
        trial->count = fit->count;
        for (uint32_t i = 0; i < 2 * fit->count; ++i)
            trial->place[i / 2][i % 2] = fit->place[i / 2][i % 2] + step[i];
        /* Only a step that explains more is taken. A shorter one from the same place costs one
         * look; a line search would cost several, and the work of a drive is bounded. */
        if (eits_fast_fit_at(fast, from, 0, trial) && trial->score > fit->score) {
            *fit = *trial;
            shorter = 1;
        } else {
            shorter *= EITS_FAST_SHORTER;
        }
        if (length < EITS_FAST_SETTLED_MM)
            return 1;
    }
    return 1;
}

/* Steps from one of the starts: both share what may be spent, and take turns at what is left. One
 * that no search has come to takes a step's work to look at. */
static uint32_t steps_of(const eits_fast *fast, uint32_t from, uint32_t touches, uint32_t start,
                         int is_new)
{
    const uint32_t spend = EITS_FAST_ANSWERS / ((fast->held_count - from) * touches);
    const uint32_t all = spend > 1 ? spend : 1;
    uint32_t steps = all / 2 + (start == fast->turn ? all % 2 : 0);
    steps -= steps > 0 && is_new;
    return steps < EITS_FAST_STEPS ? steps : EITS_FAST_STEPS;
}

/* Where the last search from about there has come to, with what drives said of it then: their bits
 * in `known`. 0 where there is none. */
static int go_on(const eits_fast *fast, fast_fit *fit, uint32_t *known)
{
    for (uint32_t k = 0; k < fast->last_count; ++k) {
        if (fast_apart(fit->place[0], fast->last[k]))
            continue;
        eits_copy(fit->place[0], fast->last[k], 2);
        for (uint32_t n = 0; n < fast->held_count; ++n) {
            if ((fast->held[n].said >> k & 1u) == 0)
                continue;
            *known |= 1u << n;
            fit->share[n] = fast->held[n].share[k];
        }
        return 1;
    }
    return 0;
}

/* The next search goes on from these. */
static void keep(eits_fast *fast, uint32_t from, const fast_fit *const fits[], uint32_t count)
{
    fast->last_count = count;
    for (uint32_t k = 0; k < count; ++k)
        eits_copy(fast->last[k], fits[k]->place[0], 2);
    for (uint32_t n = 0; n < fast->held_count; ++n) {
        fast->held[n].said = (uint8_t)(n < from ? 0u : (1u << count) - 1u);
        for (uint32_t k = 0; k < count; ++k)
            fast->held[n].share[k] = fits[k]->share[n];
    }
}

/* Whitened answers of a place on the skin in the drives from `from` on, once for all starts beside
 * it. They stand where the update's numbers do, which a drive with news does not need. */
static const eits_real *answers_of(eits_fast *fast, uint32_t from, const eits_real *place)
{
    _Static_assert(EITS_FAST_PAIR_HELD * FAST_WAYS <= FAST_NUMBERS, "room");
    eits_real *next = fast->moved;
    for (uint32_t n = from; n < fast->held_count; ++n) {
        (void)whitened(fast, &fast->held[n], place, next);
        next += FAST_WAYS * (size_t)fast->most_rows;
    }
    return fast->moved;
}

/* Fits from the greatest cells of a map, in their order; how many. */
static uint32_t fits_from(eits_fast *fast, uint32_t from, const eits_real *first, fast_fit *fit)
{
    eits_real taken[1 + EITS_FAST_STARTS][2];
    const eits_real *score = first == NULL ? fast->score : fast->pair_score;
    const uint32_t touches = first == NULL ? 1 : 2;
    const eits_real *beside = first == NULL ? NULL : answers_of(fast, from, first);
    uint32_t found = 0, places = 0;
    if (first != NULL)
        eits_copy(taken[places++], first, 2);
    for (uint32_t start = 0; start < EITS_FAST_STARTS; ++start) {
        eits_real *place = taken[places];
        uint32_t known = 0;
        int is_new = 0;
        if (!eits_fast_peak(fast, score, (const eits_real(*)[2])taken, places, place))
            break;
        ++places;
        fit[found].count = touches;
        eits_copy(fit[found].place[touches - 1], place, 2);
        if (first == NULL)
            is_new = !go_on(fast, &fit[found], &known);
        else
            eits_copy(fit[found].place[0], first, 2);
        found += (uint32_t)refine(fast, from, steps_of(fast, from, touches, start, is_new), known,
                                  beside, &fit[found]);
    }
    fast->turn ^= 1;
    return found;
}

/* Whether two fits are the same touches, in either order. */
static int are_same(const fast_fit *a, const fast_fit *b)
{
    if (a->count == 1)
        return !fast_apart(a->place[0], b->place[0]);
    return (!fast_apart(a->place[0], b->place[0]) && !fast_apart(a->place[1], b->place[1])) ||
           (!fast_apart(a->place[0], b->place[1]) && !fast_apart(a->place[1], b->place[0]));
}

const fast_fit *eits_fast_find(eits_fast *fast, uint32_t from, const eits_real *first,
                               eits_real *lead)
{
    fast_fit *fit = fast->fit;
    const uint32_t found = fits_from(fast, from, first, fit);
    /* the best first; the first of two alike */
    const uint32_t winner = found == 2 && fit[1].score > fit[0].score;
    const fast_fit *const ranked[EITS_FAST_STARTS] = {&fit[winner], &fit[1 - winner]};
    if (first == NULL)
        keep(fast, from, ranked, found);
    if (found == 0)
        return NULL;
    *lead = ranked[0]->score;
    if (found == 2 && !are_same(ranked[0], ranked[1]))
        *lead -= ranked[1]->score > 0 ? ranked[1]->score : 0;
    return ranked[0];
}

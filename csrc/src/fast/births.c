/* New touches by a matched filter over the drives that wait for an explanation.
 *
 * Each drive has a strength of its own, since a touch that lands grows from drive to drive; only
 * the place is common. So strengths are solved for at each place, and only places are stepped
 * (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413). Rows are whitened
 * by what known touches may still do. The map over cells grows by one drive at a time; its peaks
 * start damped Gauss-Newton steps, of which there are the fewer the more drives wait. */
#include "fast/fast.h"

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
        for (uint32_t j = 0; j < i; ++j) {
            const eits_real *other = fast_line(factor, j);
            line[j] = (h[i][j] * scale[i] * scale[j] - fast_dot(line, other, j)) / other[j];
        }
        line[i] = eits_sqrt(h[i][i] * scale[i] * scale[i] - fast_dot(line, line, i));
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

/* What each cell adds to a drive's explanation, onto `score`, beside a touch that answers `known`
 * (whitened; NULL: none). */
static void add_cells(eits_fast *fast, const fast_held *held, const eits_real *known,
                      eits_real *score)
{
    const uint32_t rows = fast->drive[held->drive].count;
    const eits_real energy = known == NULL ? 0 : fast_dot(known, known, rows);
    const eits_real size = energy > 0 ? fast_dot(known, held->white, rows) / energy : 0;
    eits_real *answer = fast->spare;
    for (uint32_t n = 0; n < fast->cells; ++n) {
        eits_fast_answer_of_pixel(fast, held->drive, fast->cell[n], answer);
        fast_whiten(held->factor, answer, rows);
        eits_real along = fast_dot(answer, held->white, rows);
        if (energy > 0) {
            const eits_real shared = fast_dot(known, answer, rows);
            fast_axpy(answer, -(shared / energy), known, rows);
            along = fast_dot(answer, held->white, rows) - size * fast_dot(answer, known, rows);
        }
        along *= fast->sign;
        const eits_real own = fast_dot(answer, answer, rows);
        if (along > 0 && own > 0)
            score[n] += along * along / own;
    }
}

void eits_fast_map(eits_fast *fast, const fast_held *held)
{
    add_cells(fast, held, NULL, fast->score);
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

/* What a drive says of moving the touches, onto h and b: derivatives less what strengths can do of
 * them. `answer` are the touches' whitened answers; derivatives are spent, answers become an
 * orthonormal basis. */
static void add_normal(fast_fit *fit, eits_real *const answer[2], size_t stride,
                       const eits_real *strength, const eits_real *rest, uint32_t rows)
{
    uint32_t basis = 0;
    const eits_real *unit[2] = {NULL, NULL};
    for (uint32_t i = 0; i < fit->count; ++i) {
        fit->variance[i] = 0;
        for (uint32_t way = 1; way < FAST_WAYS; ++way) {
            for (uint32_t r = 0; r < rows; ++r)
                answer[i][way * stride + r] *= strength[i];
        }
        if (strength[i] == 0)
            continue;
        for (uint32_t q = 0; q < basis; ++q)
            fast_axpy(answer[i], -fast_dot(unit[q], answer[i], rows), unit[q], rows);
        fit->variance[i] = 1 / fast_dot(answer[i], answer[i], rows);
        const eits_real scale = eits_sqrt(fit->variance[i]);
        for (uint32_t r = 0; r < rows; ++r)
            answer[i][r] *= scale;
        unit[basis++] = answer[i];
    }
    for (uint32_t i = 0; i < 2 * fit->count; ++i) {
        eits_real *slope = answer[i / 2] + (1 + i % 2) * stride;
        for (uint32_t q = 0; q < basis; ++q)
            fast_axpy(slope, -fast_dot(unit[q], slope, rows), unit[q], rows);
        fit->b[i] += fast_dot(slope, rest, rows);
        for (uint32_t j = 0; j <= i; ++j) {
            fit->h[i][j] += fast_dot(slope, answer[j / 2] + (1 + j % 2) * stride, rows);
            fit->h[j][i] = fit->h[i][j];
        }
    }
}

/* One drive of a fit; 0 where a place is off the skin. */
static int add_drive(eits_fast *fast, const fast_held *held, uint32_t number, fast_fit *fit)
{
    const uint32_t rows = fast->drive[held->drive].count;
    const size_t stride = fast->most_rows;
    eits_real *answer[2] = {fast->answer, fast->answer + FAST_WAYS * stride};
    const eits_real *g[2] = {answer[0], answer[1]};
    eits_real *rest = fast->spare, *strength = fit->strength[number];
    for (uint32_t i = 0; i < fit->count; ++i) {
        if (!eits_fast_answer(fast, held->drive, fit->place[i], answer[i]))
            return 0;
        for (uint32_t way = 0; way < FAST_WAYS; ++way)
            fast_whiten(held->factor, answer[i] + way * stride, rows);
    }
    solve_strengths(fast, g, fit->count, held->white, rows, strength);
    eits_copy(rest, held->white, rows);
    for (uint32_t i = 0; i < fit->count; ++i)
        fast_axpy(rest, -strength[i], g[i], rows);
    const eits_real left = fast_dot(rest, rest, rows);
    const eits_real all = fast_dot(held->white, held->white, rows);
    fit->left[number] = left;
    fit->left_all += left;
    fit->score += all - left;
    for (uint32_t i = 0; i < fit->count; ++i) {
        eits_real without = all, other = 0;
        if (fit->count == 2) {
            const uint32_t o = 1 - i;
            solve_strengths(fast, &g[o], 1, held->white, rows, &other);
            without +=
                (other * fast_dot(g[o], g[o], rows) - 2 * fast_dot(g[o], held->white, rows)) *
                other;
        }
        fit->own[i] += without - left;
    }
    add_normal(fit, answer, stride, strength, rest, rows);
    return 1;
}

int eits_fast_fit_at(eits_fast *fast, uint32_t from, fast_fit *fit)
{
    fast_fit made = {.count = fit->count};
    memcpy(made.place, fit->place, sizeof made.place);
    for (uint32_t n = from; n < fast->held_count; ++n) {
        if (!add_drive(fast, &fast->held[n], n - from, &made))
            return 0;
    }
    *fit = made;
    return 1;
}

/* The step that the normal equations ask for, at most EITS_FAST_MAX_STEP_MM along an axis; its
 * length, or below 0 where they are singular. */
static eits_real damped_step(const fast_fit *fit, eits_real shorter, eits_real *step)
{
    const uint32_t n = 2 * fit->count;
    eits_real damped[4][4], inverse[4][4], length = 0;
    memcpy(damped, fit->h, sizeof damped);
    for (uint32_t i = 0; i < n; ++i)
        damped[i][i] = fit->h[i][i] + EITS_FAST_DAMPING * fit->h[i][i];
    if (!eits_fast_invert((const eits_real(*)[4])damped, n, inverse))
        return -1;
    for (uint32_t i = 0; i < n; ++i) {
        step[i] = shorter * fast_dot(inverse[i], fit->b, n);
        length = eits_fabs(step[i]) > length ? eits_fabs(step[i]) : length;
    }
    if (!(length > EITS_FAST_MAX_STEP_MM))
        return length;
    for (uint32_t i = 0; i < n; ++i)
        step[i] *= EITS_FAST_MAX_STEP_MM / length;
    return EITS_FAST_MAX_STEP_MM;
}

/* Damped Gauss-Newton steps from fit->place; 0 where it is off the skin. */
static int refine(eits_fast *fast, uint32_t from, fast_fit *fit)
{
    const uint32_t answers = (fast->held_count - from) * fit->count;
    uint32_t steps = EITS_FAST_ANSWERS / answers;
    steps = steps > 1 + EITS_FAST_STEPS ? EITS_FAST_STEPS : steps > 2 ? steps - 1 : 1;
    eits_real shorter = 1, step[4];
    if (!eits_fast_fit_at(fast, from, fit))
        return 0;
    for (; steps > 0; --steps) {
        const eits_real length = damped_step(fit, shorter, step);
        if (length < 0)
            return 1;
        fast_fit trial = *fit;
        for (uint32_t i = 0; i < 2 * fit->count; ++i)
            trial.place[i / 2][i % 2] += step[i];
        if (eits_fast_fit_at(fast, from, &trial) && trial.score > fit->score) {
            *fit = trial;
            shorter = 1;
        } else {
            shorter *= EITS_FAST_SHORTER;
        }
        if (length < EITS_FAST_SETTLED_MM)
            return 1;
    }
    return 1;
}

/* The pixel's centre, mm. */
static void centre(const eits_fast *fast, uint32_t pixel, eits_real *place)
{
    const eits_model *m = fast->model;
    const eits_real side = (eits_real)m->pixel_mm;
    place[0] = (eits_real)m->origin_x_mm + ((eits_real)m->pixel[pixel].ix + R(0.5)) * side;
    place[1] = (eits_real)m->origin_y_mm + ((eits_real)m->pixel[pixel].iy + R(0.5)) * side;
}

/* The greatest cell of `score` apart from the `count` places; 0 where nothing is above zero. */
static int peak(const eits_fast *fast, const eits_real *score, const eits_real (*places)[2],
                uint32_t count, eits_real *place)
{
    eits_real greatest = 0;
    for (uint32_t n = 0; n < fast->cells; ++n) {
        eits_real here[2];
        if (!(score[n] > greatest))
            continue;
        centre(fast, fast->cell[n], here);
        int free = 1;
        for (uint32_t k = 0; k < count; ++k)
            free &= fast_apart(here, places[k]);
        if (free) {
            greatest = score[n];
            eits_copy(place, here, 2);
        }
    }
    return greatest > 0;
}

/* Where the last drive's search from about there has come to. */
static void go_on(const eits_fast *fast, eits_real *place)
{
    for (uint32_t k = 0; k < fast->last_count; ++k) {
        if (!fast_apart(place, fast->last[k])) {
            eits_copy(place, fast->last[k], 2);
            return;
        }
    }
}

/* The map beside a first touch, of the newest drives that wait. */
static void map_beside(eits_fast *fast, const eits_real *first)
{
    const uint32_t from =
        fast->held_count > EITS_FAST_PAIR_DRIVES ? fast->held_count - EITS_FAST_PAIR_DRIVES : 0;
    eits_zero(fast->pair_score, fast->cells);
    for (uint32_t n = from; n < fast->held_count; ++n) {
        const fast_held *held = &fast->held[n];
        (void)eits_fast_answer(fast, held->drive, first, fast->answer);
        fast_whiten(held->factor, fast->answer, fast->drive[held->drive].count);
        add_cells(fast, held, fast->answer, fast->pair_score);
    }
}

int eits_fast_find(eits_fast *fast, uint32_t from, const eits_real *first, fast_fit *best,
                   eits_real *lead)
{
    fast_fit fit[EITS_FAST_STARTS];
    eits_real taken[1 + EITS_FAST_STARTS][2];
    const eits_real *score = fast->score;
    uint32_t found = 0, places = 0;
    if (first != NULL) {
        map_beside(fast, first);
        score = fast->pair_score;
        eits_copy(taken[places++], first, 2);
    }
    for (uint32_t start = 0; start < EITS_FAST_STARTS; ++start) {
        eits_real *place = taken[places];
        if (!peak(fast, score, (const eits_real(*)[2])taken, places, place))
            break;
        ++places;
        fit[found].count = first == NULL ? 1 : 2;
        eits_copy(fit[found].place[fit[found].count - 1], place, 2);
        if (first == NULL)
            go_on(fast, fit[found].place[0]);
        else
            eits_copy(fit[found].place[0], first, 2);
        found += (uint32_t)refine(fast, from, &fit[found]);
    }
    if (first == NULL)
        fast->last_count = found;
    if (found == 0)
        return 0;
    /* the best first; the first of two alike */
    const uint32_t winner = found == 2 && fit[1].score > fit[0].score;
    const uint32_t own = fit[winner].count - 1;
    *best = fit[winner];
    *lead = best->score;
    if (found == 2 && fast_apart(best->place[own], fit[1 - winner].place[own]))
        *lead -= fit[1 - winner].score > 0 ? fit[1 - winner].score : 0;
    if (first == NULL) {
        eits_copy(fast->last[0], fit[winner].place[0], 2);
        if (found == 2)
            eits_copy(fast->last[1], fit[1 - winner].place[0], 2);
    }
    return 1;
}

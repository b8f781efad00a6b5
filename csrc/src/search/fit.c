/* A hypothesis fitted to drives that wait.
 *
 * Each drive has a strength of its own for each new touch, since a touch that lands grows from
 * drive to drive; only places and speeds are common. So strengths are solved for in each drive, and
 * only places and speeds are stepped (variable projection: Golub and Pereyra, SIAM J. Numer. Anal.
 * 10 (1973) 413). Known touches keep their strengths: with strengths free to change in the
 * whitening, that costs nothing. */
#include "search/search.h"

void eits_trial_begin(const eits_fast *fast, fast_trial *trial, uint32_t count)
{
    trial->exists = trial->as_known = 0;
    trial->bodies = trial->fresh = 0;
    trial->count = (uint8_t)(count < fast->search.count ? count : fast->search.count);
    trial->from = (uint8_t)(fast->search.count - trial->count);
    trial->gone = FAST_NONE;
    trial->rho2 = fast->rho2;
    trial->cost = trial->lead = 0;
}

void eits_trial_add_new(fast_trial *trial, const eits_real *place, int moves)
{
    ++trial->fresh;
    trial->body[trial->bodies++] =
        (fast_body){.known = FAST_NONE,
                    .numbers = moves ? 4 : 2,
                    .p = {place[0], place[1], 0, 0},
                    .tight = {0, 1 / fast_square(2 * EITS_FAST_MOVE_SPEED)}};
}

eits_real eits_waited_s(const eits_fast *fast, const fast_trial *trial)
{
    uint32_t drives = 1; /* with the present one */
    for (uint32_t bits = fast->unexplained; (bits & 1u) != 0; bits >>= 1)
        ++drives;
    const uint32_t own = fast->ring_count - fast->search.from - trial->from;
    return drives > own ? (eits_real)(drives - own) * EITS_FAST_DRIVE_S : 0;
}

void eits_trial_add_known(const eits_fast *fast, fast_trial *trial, uint32_t k)
{
    /* A later beginning leaves more room for what came before it. A touch that rests has not gone
     * on since drives were last explained; another one has. */
    const eits_real late = search_rests(fast, k)
                               ? fast_between_s(fast->ring[fast->search.from]->time_us,
                                                search_drive(fast, trial, 0)->time_us)
                               : eits_waited_s(fast, trial);
    const eits_real offset = EITS_FAST_MOVE_MM + R(0.3) * EITS_FAST_MOVE_SPEED * late;
    const int turns = fast->known[k].moving || search_rests(fast, k);
    const eits_real speed = turns ? EITS_FAST_TURN_SPEED : EITS_FAST_MOVE_SPEED;
    trial->body[trial->bodies++] =
        (fast_body){.known = (uint8_t)k,
                    .numbers = 4,
                    .tight = {1 / fast_square(offset), 1 / fast_square(speed)}};
}

/* ---- one drive ---- */

void eits_trial_answer(eits_fast *fast, const fast_held *held, const fast_disc *disc,
                       const fast_sight *sight, uint32_t without, eits_real *out)
{
    const uint32_t rows = fast->drive[held->drive].count;
    eits_fast_answer(fast, held->drive, disc, out);
    for (uint32_t k = 0; k < held->count; ++k) {
        if (k != without)
            eits_fast_add_interplay(fast, held->drive, sight, &fast->sight[k],
                                    held->state[k][FAST_C], out);
    }
    /* A row that is not in use says nothing of touches: neither that there is one nor none. */
    for (uint32_t i = 0; i < rows; ++i) {
        for (uint32_t way = 0; way < FAST_WAYS && (held->used >> i & 1u) == 0; ++way)
            out[(size_t)way * fast->most_rows + i] = 0;
    }
    eits_fast_whiten_ways(held, fast->most_rows, rows, out);
}

/* Find the place of body i at a drive, dt after its trial's instant. */
static eits_real place_at(const eits_fast *fast, const fast_trial *trial, const fast_held *held,
                          uint32_t i, eits_real *place)
{
    const fast_body *body = &trial->body[i];
    const int is_new = body->known == FAST_NONE;
    const uint32_t reference = is_new ? search_drive(fast, trial, trial->count - 1u)->time_us
                                      : search_drive(fast, trial, 0)->time_us;
    const eits_real dt =
        fast_between_s(reference, held->time_us) + (is_new ? 0 : EITS_FAST_DRIVE_S / 2);
    for (uint32_t axis = 0; axis < 2; ++axis) {
        place[axis] = body->p[axis] + (body->numbers == 4 ? dt * body->p[2 + axis] : 0) +
                      (is_new ? 0 : held->state[body->known][axis]);
    }
    return dt;
}

void eits_trial_place(const eits_fast *fast, const fast_trial *trial, uint32_t i, eits_real *place)
{
    (void)place_at(fast, trial, search_drive(fast, trial, trial->count - 1u), i, place);
}

/* Least squares of `rest` by one or two answers, none below zero: touches of the wrong sign would
 * let two near places cancel each other and explain any noise. */
static void solve_strengths(const eits_real *const *g, uint32_t count, const eits_real *rest,
                            uint32_t rows, eits_real *strength)
{
    eits_real gram[FAST_NEW], toward[FAST_NEW], alone[FAST_NEW];
    for (uint32_t i = 0; i < count; ++i) {
        gram[i] = fast_dot(g[i], g[i], rows);
        toward[i] = fast_dot(g[i], rest, rows);
        alone[i] = gram[i] > 0 && toward[i] > 0 ? toward[i] / gram[i] : 0;
        strength[i] = alone[i];
    }
    if (count < 2)
        return;
    const eits_real cross = fast_dot(g[0], g[1], rows), both = gram[0] * gram[1];
    const eits_real det = both - cross * cross;
    const eits_real first = gram[1] * toward[0] - cross * toward[1];
    const eits_real second = gram[0] * toward[1] - cross * toward[0];
    if (det > EITS_FAST_SINGULAR * both && first >= 0 && second >= 0) {
        strength[0] = first / det;
        strength[1] = second / det;
    } else {
        strength[alone[0] * toward[0] < alone[1] * toward[1] ? 0 : 1] = 0;
    }
}

/* One drive while a hypothesis is fitted to it. */
typedef struct at_hand {
    const fast_held *held;
    uint32_t rows, columns;
    eits_real *rest;             /* what the hypothesis leaves */
    eits_real *way[FAST_BODIES]; /* whitened answers, and their slopes */
    eits_real dt[FAST_BODIES];
    fast_sight *sight;
} at_hand;

static eits_real rho2_of(const eits_fast *fast, const fast_trial *trial, uint32_t i)
{
    const uint8_t known = trial->body[i].known;
    return known == FAST_NONE ? trial->rho2 : fast->known[known].rho2;
}

/* Answers of one body in this drive. Where it is as the known touch was, they stand in the ring. */
static int answer_body(eits_fast *fast, const fast_trial *trial, uint32_t i, at_hand *at)
{
    const size_t size = FAST_WAYS * (size_t)fast->most_rows;
    const uint8_t known = trial->body[i].known;
    const uint32_t k = known == FAST_NONE ? trial->gone : known;
    eits_real place[2];
    at->way[i] = fast->search.ways + size * i;
    at->dt[i] = place_at(fast, trial, at->held, i, place);
    if (trial->as_known) {
        eits_copy(at->way[i], at->held->known + size * k, size);
        return 1;
    }
    /* without a speed it is where it was looked at in all drives */
    fast_disc *disc = &fast->search.disc[i];
    if ((known != FAST_NONE || trial->body[i].numbers == 4) &&
        !eits_fast_gather(fast, place, rho2_of(fast, trial, i), disc))
        return 0;
    eits_trial_answer(fast, at->held, disc, &at->sight[i], k, at->way[i]);
    return 1;
}

/* Answers of all bodies; what moved ones do is taken out of `rest`. */
static int answer_bodies(eits_fast *fast, const fast_trial *trial, at_hand *at)
{
    const size_t size = FAST_WAYS * (size_t)fast->most_rows;
    for (uint32_t i = 0; i < trial->bodies; ++i) {
        const uint8_t k = trial->body[i].known;
        if (!answer_body(fast, trial, i, at))
            return 0;
        if (k == FAST_NONE || trial->as_known)
            continue;
        const eits_real c = at->held->state[k][FAST_C];
        fast_axpy(at->rest, c, at->held->known + size * k, at->rows);
        fast_axpy(at->rest, -c, at->way[i], at->rows);
    }
    return 1;
}

/* Two new touches bend each other's field: half of it is put down to each. */
static void add_mutual(eits_fast *fast, at_hand *at, eits_real *const g[FAST_NEW],
                       eits_real *strength)
{
    eits_real *both = fast->spare;
    eits_zero(both, at->rows);
    eits_fast_add_interplay(fast, at->held->drive, &at->sight[0], &at->sight[1], R(0.5), both);
    for (uint32_t i = 0; i < at->rows; ++i)
        both[i] = at->held->used >> i & 1u ? both[i] : 0;
    fast_whiten(at->held->factor, both, at->rows);
    fast_axpy(g[0], strength[1], both, at->rows);
    fast_axpy(g[1], strength[0], both, at->rows);
    const eits_real *const from[FAST_NEW] = {g[0], g[1]};
    solve_strengths(from, 2, at->rest, at->rows, strength);
}

/* Strengths of the new touches in this drive, and what each explains beside the other. */
static void take_out_new(eits_fast *fast, fast_trial *trial, at_hand *at, eits_real *strength)
{
    const uint32_t first = trial->bodies - trial->fresh;
    eits_real *g[FAST_NEW] = {at->way[first], trial->fresh > 1 ? at->way[first + 1] : NULL};
    const eits_real *const from[FAST_NEW] = {g[0], g[1]};
    solve_strengths(from, trial->fresh, at->rest, at->rows, strength);
    if (trial->fresh > 1)
        add_mutual(fast, at, g, strength);
    const eits_real all = fast_dot(at->rest, at->rest, at->rows);
    eits_real without[FAST_NEW] = {all, all};
    for (uint32_t i = 0; i < trial->fresh && trial->fresh > 1; ++i) {
        const eits_real *other = g[1 - i];
        eits_real alone = 0;
        solve_strengths(&other, 1, at->rest, at->rows, &alone);
        without[i] +=
            (alone * fast_dot(other, other, at->rows) - 2 * fast_dot(other, at->rest, at->rows)) *
            alone;
    }
    for (uint32_t i = 0; i < trial->fresh; ++i)
        fast_axpy(at->rest, -strength[i], g[i], at->rows);
    const eits_real left = fast_dot(at->rest, at->rest, at->rows);
    for (uint32_t i = 0; i < trial->fresh; ++i)
        trial->own[i] += without[i] - left;
}

/* Answers of new touches become an orthonormal basis, those without strength aside; how many. */
static uint32_t make_basis(fast_trial *trial, const at_hand *at, const eits_real *strength,
                           eits_real *unit[FAST_NEW])
{
    const uint32_t first = trial->bodies - trial->fresh;
    uint32_t basis = 0;
    for (uint32_t i = 0; i < trial->fresh; ++i) {
        eits_real *answer = at->way[first + i];
        trial->variance[i] = 0;
        if (strength[i] == 0)
            continue;
        for (uint32_t q = 0; q < basis; ++q)
            fast_axpy(answer, -fast_dot(unit[q], answer, at->rows), unit[q], at->rows);
        trial->variance[i] = 1 / fast_dot(answer, answer, at->rows);
        const eits_real scale = eits_sqrt(trial->variance[i]);
        for (uint32_t r = 0; r < at->rows; ++r)
            answer[r] *= scale;
        unit[basis++] = answer;
    }
    return basis;
}

/* Make the columns that a move of the bodies adds to the rows, less what new strengths can add. */
static void make_columns(eits_fast *fast, fast_trial *trial, at_hand *at, const eits_real *strength)
{
    eits_real *unit[FAST_NEW];
    const uint32_t basis = make_basis(trial, at, strength, unit);
    const uint32_t first = trial->bodies - trial->fresh;
    at->columns = 0;
    for (uint32_t i = 0; i < trial->bodies; ++i) {
        const fast_body *body = &trial->body[i];
        const eits_real c = i < first ? at->held->state[body->known][FAST_C] : strength[i - first];
        for (uint32_t k = 0; k < body->numbers; ++k) {
            const eits_real *slope = at->way[i] + (1 + k % 2) * (size_t)fast->most_rows;
            eits_real *column = fast->search.column + (size_t)fast->most_rows * at->columns++;
            const eits_real by = k < 2 ? c : c * at->dt[i];
            for (uint32_t r = 0; r < at->rows; ++r)
                column[r] = by * slope[r];
            for (uint32_t q = 0; q < basis; ++q)
                fast_axpy(column, -fast_dot(unit[q], column, at->rows), unit[q], at->rows);
        }
    }
}

static void add_equations(const eits_fast *fast, fast_trial *trial, const at_hand *at)
{
    uint32_t next = 0;
    for (uint32_t i = 0; i < at->columns; ++i) {
        const eits_real *column = fast->search.column + (size_t)fast->most_rows * i;
        trial->b[i] += fast_dot(column, at->rest, at->rows);
        for (uint32_t j = 0; j <= i; ++j)
            trial->h[next++] +=
                fast_dot(column, fast->search.column + (size_t)fast->most_rows * j, at->rows);
    }
}

/* Return the cost of known strengths that seem to have changed at once, which they seldom do. */
static eits_real cost_of_change(const eits_fast *fast, const fast_trial *trial, const at_hand *at)
{
    eits_real cost = 0;
    for (uint32_t k = 0; k < at->held->count; ++k) {
        const eits_real *known = at->held->known + FAST_WAYS * (size_t)fast->most_rows * k;
        if (k == trial->gone || !fast->known[k].on)
            continue;
        const eits_real change = fast->known[k].peak * fast_dot(known, at->rest, at->rows);
        const eits_real each = fast_square(change / EITS_FAST_CHANGES);
        cost += each < EITS_FAST_CHANGE_MOST ? each : EITS_FAST_CHANGE_MOST;
    }
    return cost;
}

static int say_drive(eits_fast *fast, fast_trial *trial, uint32_t n, at_hand *at)
{
    const fast_held *held = at->held = search_drive(fast, trial, n);
    at->rows = fast->drive[held->drive].count;
    at->rest = fast->search.rest;
    eits_copy(at->rest, held->white, at->rows);
    if (trial->gone != FAST_NONE)
        fast_axpy(at->rest, held->state[trial->gone][FAST_C],
                  held->known + FAST_WAYS * (size_t)fast->most_rows * trial->gone, at->rows);
    if (!answer_bodies(fast, trial, at))
        return 0;
    if (trial->fresh > 0)
        take_out_new(fast, trial, at, trial->strength[n]);
    trial->left += fast_dot(at->rest, at->rest, at->rows);
    trial->change += cost_of_change(fast, trial, at);
    make_columns(fast, trial, at, trial->strength[n]);
    add_equations(fast, trial, at);
    return 1;
}

/* Known touches bend the field at each body; what they do to it changes little as it moves a
 * little.
 */
static int look_at_bodies(eits_fast *fast, const fast_trial *trial, fast_sight *sight)
{
    const int alone = fast->count == 0 && trial->bodies == 1;
    for (uint32_t i = 0; i < trial->bodies; ++i) {
        const eits_real rho2 = rho2_of(fast, trial, i);
        fast_disc *disc = &fast->search.disc[i];
        eits_real place[2];
        eits_trial_place(fast, trial, i, place);
        sight[i].field = fast->search.fields + (2 * (size_t)fast->model->n_electrodes + 4) * i;
        if (!eits_fast_gather(fast, place, rho2, disc))
            return 0;
        if (!alone)
            eits_fast_look(fast, place, rho2, disc, &sight[i]);
    }
    return 1;
}

static void begin_sums(fast_trial *trial)
{
    const uint32_t n = eits_trial_numbers(trial);
    trial->left = trial->change = trial->own[0] = trial->own[1] = 0;
    eits_zero(trial->b, n);
    eits_zero(trial->h, (size_t)n * (n + 1) / 2);
    for (uint32_t i = 0, at = 0; i < trial->bodies; at += trial->body[i++].numbers) {
        const fast_body *body = &trial->body[i];
        for (uint32_t k = 0; k < body->numbers; ++k) {
            const eits_real tight = body->tight[k / 2];
            trial->left += tight * fast_square(body->p[k]);
            trial->b[at + k] = -(tight * body->p[k]);
            trial->h[(size_t)(at + k) * (at + k + 1) / 2 + at + k] = tight;
        }
    }
}

int eits_trial_say(eits_fast *fast, fast_trial *trial)
{
    fast_sight sight[FAST_BODIES];
    at_hand at = {.sight = sight};
    trial->exists = 0;
    begin_sums(trial);
    trial->all = 0;
    if (!trial->as_known && !look_at_bodies(fast, trial, sight))
        return 0;
    for (uint32_t n = 0; n < trial->count; ++n) {
        trial->all += search_drive(fast, trial, n)->chi2;
        if (!say_drive(fast, trial, n, &at))
            return 0;
    }
    trial->exists = 1;
    /* beside the answers themselves, equations take a part of the work */
    fast->search.spent += search_cost(trial, trial->bodies);
    return 1;
}

void eits_trial_refine(eits_fast *fast, fast_trial *trial, uint32_t steps)
{
    fast_search *s = &fast->search;
    s->stepped = trial;
    s->steps = trial->exists ? steps : 0;
    s->shorter = 1;
}

/* The trial with its numbers moved by a step. */
static void move_by(const fast_trial *trial, const eits_real *step, fast_trial *next)
{
    *next = *trial;
    next->as_known = 0;
    for (uint32_t i = 0, at = 0; i < next->bodies; at += next->body[i++].numbers) {
        for (uint32_t k = 0; k < next->body[i].numbers; ++k)
            next->body[i].p[k] += step[at + k];
    }
}

void eits_trial_take_step(eits_fast *fast)
{
    fast_search *s = &fast->search;
    fast_trial *trial = s->stepped, *next = &s->next;
    eits_real step[FAST_FIT];
    const eits_real length = eits_trial_step(trial, s->shorter, step);
    --s->steps;
    if (length < 0) {
        s->steps = 0;
        return;
    }
    move_by(trial, step, next);
    /* A shorter step from the same place costs one look; a line search would cost several, and the
     * work of a drive is bounded. */
    if (eits_trial_say(fast, next) && next->left < trial->left) {
        *trial = *next;
        s->shorter = 1;
    } else {
        s->shorter *= EITS_FAST_SHORTER;
    }
    if (length < EITS_FAST_SETTLED_MM)
        s->steps = 0;
}

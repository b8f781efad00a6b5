/* Acting on a hypothesis changes the known touches. The hypothesis holds for the last drive of its
 * search; drives may have come since. */
#include "search/search.h"

/* All drives of the trial, and those since, are explained, and wait no more. The present drive is
 * counted later. */
static void end(eits_fast *fast, const fast_trial *trial)
{
    for (uint32_t n = fast->search.from + trial->from; n < fast->ring_count; ++n) {
        fast->drive[fast->ring[n]->drive].explained = 1;
        if (n + 1 < fast->ring_count)
            fast->unexplained &= ~(1u << (fast->ring_count - n - 2));
    }
    eits_fast_empty_ring(fast);
}

/* Add the square of each deviation to a covariance's diagonal. */
static void add_doubt(eits_real (*covariance)[FAST_SIZE], eits_real place_mm, eits_real strength,
                      eits_real speed)
{
    const eits_real by[FAST_SIZE] = {place_mm, place_mm, strength, speed, speed};
    for (uint32_t i = 0; i < FAST_SIZE; ++i)
        covariance[i][i] += fast_square(by[i]);
}

/* A body's own part of its trial's covariance, `at` its first number, times `doubt`, `dt` later. */
static void body_covariance(eits_real all[FAST_FIT][FAST_FIT], uint32_t at, uint32_t numbers,
                            eits_real dt, eits_real doubt, eits_real (*out)[FAST_SIZE])
{
    static const uint8_t STATE[4] = {FAST_X, FAST_Y, FAST_VX, FAST_VY};
    eits_real part[4][4];
    memset(out, 0, FAST_SIZE * sizeof *out);
    for (uint32_t i = 0; i < numbers; ++i) {
        for (uint32_t j = 0; j < numbers; ++j)
            part[i][j] = doubt * all[at + i][at + j];
    }
    for (uint32_t i = 0; i < 2 && numbers == 4; ++i) /* place += dt speed: rows, then columns */
        fast_axpy(part[i], dt, part[i + 2], 4);
    for (uint32_t i = 0; i < 4 && numbers == 4; ++i) {
        part[i][0] += dt * part[i][2];
        part[i][1] += dt * part[i][3];
    }
    for (uint32_t i = 0; i < numbers; ++i) {
        for (uint32_t j = 0; j < numbers; ++j)
            out[STATE[i]][STATE[j]] = part[i][j];
    }
}

static uint32_t first_number(const fast_trial *trial, uint32_t body)
{
    uint32_t at = 0;
    for (uint32_t i = 0; i < body; ++i)
        at += trial->body[i].numbers;
    return at;
}

void eits_apply_move(eits_fast *fast, const fast_trial *trial)
{
    eits_real covariance[FAST_FIT][FAST_FIT];
    const eits_real dt = EITS_FAST_DRIVE_S / 2 +
                         fast_between_s(search_drive(fast, trial, 0)->time_us, fast->time_us);
    if (!eits_trial_covariance(trial, covariance))
        return;
    for (uint32_t i = 0; i + trial->fresh < trial->bodies; ++i) {
        const fast_body *body = &trial->body[i];
        const uint32_t k = body->known;
        const eits_real by[2] = {body->p[0] + dt * body->p[2], body->p[1] + dt * body->p[3]};
        const eits_real *then = search_drive(fast, trial, trial->count - 1u)->state[k];
        eits_real *state = fast->state + (size_t)FAST_SIZE * k, own[FAST_SIZE][FAST_SIZE];
        if (!(by[0] * by[0] + by[1] * by[1] > fast_square(EITS_FAST_MOVED_LEAST_MM)))
            continue;
        body_covariance(covariance, first_number(trial, i), 4, dt, 1, own);
        own[FAST_C][FAST_C] = fast->p[FAST_SIZE * k + FAST_C][FAST_SIZE * k + FAST_C];
        add_doubt(own, EITS_FAST_MOVED_DOUBT_MM, EITS_FAST_BORN_STRENGTH * fast->known[k].peak,
                  EITS_FAST_MOVED_DOUBT_SPEED);
        for (uint32_t axis = 0; axis < 2; ++axis) {
            state[axis] = then[axis] + by[axis];
            state[FAST_VX + axis] += body->p[2 + axis];
        }
        fast->known[k].moving = 1;
        fast->known[k].slow = 0;
        eits_fast_set_covariance(fast, k, own);
    }
    if (trial->fresh == 0)
        end(fast, trial);
}

/* A touch whose signal was there in full from the trial's second drive on may swipe. A slower one
 * hardly does, and another may land beside it. */
static eits_real first_speed(const eits_fast *fast, const fast_trial *trial)
{
    const fast_held *second = search_drive(fast, trial, trial->count > 2);
    return second->chi2 > EITS_FAST_SUDDEN ? EITS_FAST_FIRST_SPEED : EITS_FAST_FIRST_SLOW;
}

/* A first touch may move from its contact on, as a swipe does, where nothing else can drag it. One
 * that still grows is landing, and another may land beside it. */
static int may_move(const eits_fast *fast, const fast_trial *trial, uint32_t which)
{
    const uint32_t last = trial->count - 1u, first = last > 1 ? 1 : 0;
    return fast->count == 0 && trial->fresh == 1 &&
           trial->strength[last][which] < EITS_FAST_GROWS * trial->strength[first][which];
}

/* The state and covariance of a new touch of the trial. */
static void new_state(const eits_fast *fast, const fast_trial *trial, uint32_t i,
                      eits_real all[FAST_FIT][FAST_FIT], eits_real *state,
                      eits_real (*covariance)[FAST_SIZE])
{
    const fast_body *body = &trial->body[i];
    const uint32_t which = i + trial->fresh - trial->bodies;
    const eits_real doubt = eits_doubt(fast, trial);
    const eits_real c = trial->strength[trial->count - 1u][which];
    const eits_real dt =
        fast_between_s(search_drive(fast, trial, trial->count - 1u)->time_us, fast->time_us);
    const int moves = body->numbers == 4;
    body_covariance(all, first_number(trial, i), body->numbers, dt, doubt, covariance);
    covariance[FAST_C][FAST_C] = doubt * trial->variance[which];
    add_doubt(covariance, EITS_FAST_BORN_MM, EITS_FAST_BORN_STRENGTH * c,
              moves                          ? EITS_FAST_BORN_SPEED
              : may_move(fast, trial, which) ? first_speed(fast, trial)
                                             : 0);
    state[FAST_C] = c;
    for (uint32_t axis = 0; axis < 2; ++axis) {
        state[axis] = body->p[axis] + (moves ? dt * body->p[2 + axis] : 0);
        state[FAST_VX + axis] = moves ? body->p[2 + axis] : 0;
    }
}

void eits_apply_replace(eits_fast *fast, const fast_trial *trial)
{
    eits_real all[FAST_FIT][FAST_FIT], covariance[FAST_SIZE][FAST_SIZE];
    const uint32_t k = trial->gone;
    fast_known *known = &fast->known[k];
    if (!eits_trial_covariance(trial, all))
        return;
    eits_real *state = fast->state + (size_t)FAST_SIZE * k;
    new_state(fast, trial, 0, all, state, covariance);
    eits_fast_set_covariance(fast, k, covariance);
    known->rho2 = trial->rho2;
    known->moving = trial->body[0].numbers == 4;
    eits_fast_put_on(fast, k);
    known->slow = known->age = known->off_drives = 0;
    known->peak = eits_larger(state[FAST_C], R(0.3) * known->peak);
    end(fast, trial);
}

/* Touches where one is born, all of which are off: it is another press. */
static void forget_near(eits_fast *fast, const eits_real *place)
{
    for (uint32_t k = fast->count; k-- > 0;) {
        if (!fast_apart(place, fast->state + FAST_SIZE * k))
            eits_fast_forget(fast, k);
    }
}

/* Drives remember it as if it had been known. */
static void remember(eits_fast *fast, const fast_trial *trial, uint32_t which,
                     const eits_real *place)
{
    for (uint32_t n = 0; n < trial->count; ++n) {
        fast_drive *d = &fast->drive[search_drive(fast, trial, n)->drive];
        d->there[fast->count - 1] = 1;
        d->then[fast->count - 1][FAST_X] = place[0];
        d->then[fast->count - 1][FAST_Y] = place[1];
        d->then[fast->count - 1][FAST_C] = trial->strength[n][which];
    }
}

void eits_apply_birth(eits_fast *fast, const fast_trial *trial)
{
    eits_real all[FAST_FIT][FAST_FIT], state[FAST_NEW][FAST_SIZE];
    eits_real covariance[FAST_NEW][FAST_SIZE][FAST_SIZE];
    const uint32_t first = trial->bodies - trial->fresh;
    if (!eits_trial_covariance(trial, all))
        return;
    for (uint32_t i = 0; i < trial->fresh; ++i)
        new_state(fast, trial, first + i, all, state[i], covariance[i]);
    if (trial->gone != FAST_NONE)
        eits_fast_forget(fast, trial->gone);
    for (uint32_t i = 0; i < trial->fresh; ++i) {
        const eits_real energy = trial->own[i] / (eits_real)trial->count;
        forget_near(fast, state[i]);
        eits_fast_add(fast, state[i], covariance[i], energy, trial->rho2);
        remember(fast, trial, i, trial->body[first + i].p);
    }
    end(fast, trial);
}

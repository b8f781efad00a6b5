/* Touches followed from drive to drive by an extended Kalman filter.
 *
 * One covariance for all of them, since touches share rows (Bar-Shalom, Li and Kirubarajan,
 * Estimation with Applications to Tracking and Navigation, Wiley 2001, ch. 10). A drive's rows are
 * taken at once: S = H P H' + R = L L', and with M = P H' the update is W = M L'^-1, state + W L^-1
 * e, P - W W'. R keeps S positive although P loses digits in float32; a pivot that is not is the
 * noise's own. */
#include "fast/fast.h"

void eits_fast_predict(eits_fast *fast, eits_real dt_s)
{
    const uint32_t n = FAST_SIZE * fast->count;
    /* F P F' without a matrix product: F adds dt times the speed to a place, so that rows change
     * first, then columns. The noise that comes with time is in proportion to it, whatever the
     * scan's rate. */
    const eits_real drives = dt_s / EITS_FAST_DRIVE_S;
    for (uint32_t k = 0; k < n; k += FAST_SIZE) {
        for (uint32_t axis = 0; axis < 2; ++axis) {
            eits_real *place = fast->p[k + axis];
            fast->state[k + axis] += dt_s * fast->state[k + FAST_VX + axis];
            fast_axpy(place, dt_s, fast->p[k + FAST_VX + axis], n);
        }
    }
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t k = 0; k < n; k += FAST_SIZE) {
            for (uint32_t axis = 0; axis < 2; ++axis)
                fast->p[i][k + axis] += dt_s * fast->p[i][k + FAST_VX + axis];
        }
    }
    for (uint32_t k = 0; k < fast->count; ++k) {
        const uint32_t at = FAST_SIZE * k;
        const eits_real speed = fast_square(EITS_FAST_SPEED_NOISE) * drives;
        const eits_real strength = EITS_FAST_STRENGTH_NOISE * fast->known[k].peak;
        fast->p[at + FAST_C][at + FAST_C] += fast_square(strength) * drives;
        fast->p[at + FAST_VX][at + FAST_VX] += speed;
        fast->p[at + FAST_VY][at + FAST_VY] += speed;
    }
}

void eits_fast_loosen(eits_fast *fast, eits_real strength, eits_real place_mm)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        const uint32_t at = FAST_SIZE * k;
        /* While drives wait, a touch that is on may lift but not move: it would go to meet the one
         * that lands. */
        const int stays = fast->known[k].on && fast->held_count > 0;
        const eits_real place = stays ? 0 : fast_square(place_mm);
        fast->p[at][at] += place;
        fast->p[at + 1][at + 1] += place;
        fast->p[at + FAST_C][at + FAST_C] += fast_square(strength * fast->known[k].peak);
    }
}

/* Row i of H, by touch the derivatives by x, y and strength. */
static void row_of_h(const eits_fast *fast, uint32_t i, eits_real h[EITS_FAST_MAX_TOUCHES][3])
{
    const size_t rows = fast->most_rows;
    for (uint32_t k = 0; k < fast->count; ++k) {
        const eits_real *answer = fast->answer + FAST_WAYS * rows * k + i;
        const eits_real strength = fast->state[FAST_SIZE * k + FAST_C];
        h[k][FAST_X] = strength * answer[rows];
        h[k][FAST_Y] = strength * answer[2 * rows];
        h[k][FAST_C] = answer[0];
    }
}

/* What is expected of row i, and what the model is wrong by in it, squared. */
static eits_real expected(const eits_fast *fast, uint32_t i, eits_real *error)
{
    eits_real sum = 0;
    *error = 0;
    for (uint32_t k = 0; k < fast->count; ++k) {
        const eits_real given = fast->state[FAST_SIZE * k + FAST_C] *
                                fast->answer[FAST_WAYS * (size_t)fast->most_rows * k + i];
        sum += given;
        *error += fast_square(EITS_FAST_MODEL_ERROR * given);
    }
    return sum;
}

/* Row i of S's factor, once those before it are known: S_ij less what they have in common. */
static void factor_row(eits_fast *fast, uint32_t i, eits_real diagonal)
{
    /* P loses digits in float32 after thousands of updates. A pivot that is not positive says that
     * the row is already known to its noise. */
    const eits_real pivot = fast_factor_row(fast->factor, i, diagonal);
    fast_line(fast->factor, i)[i] = eits_sqrt(pivot > 0 ? pivot : fast_square(fast->sigma));
}

eits_real eits_fast_innovate(eits_fast *fast, uint32_t rows)
{
    const uint32_t n = FAST_SIZE * fast->count;
    for (uint32_t i = 0; i < rows; ++i) {
        eits_real h[EITS_FAST_MAX_TOUCHES][3], error = 0;
        eits_real *moved = fast->moved + (size_t)FAST_NUMBERS * i,
                  *line = fast_line(fast->factor, i);
        eits_zero(moved, n);
        eits_zero(line, i);
        fast->e[i] = 0;
        eits_real diagonal = fast_square(fast->sigma);
        if (fast->used[i]) {
            fast->e[i] = fast->z[i] - expected(fast, i, &error);
            row_of_h(fast, i, h);
            for (uint32_t k = 0; k < fast->count; ++k) {
                for (uint32_t way = 0; way < FAST_WAYS; ++way)
                    fast_axpy(moved, h[k][way], fast->p[FAST_SIZE * k + way], n);
            }
            /* S_ij = h_i P h_j', of which P h_j' stands in `moved`: only the three numbers of a
             * touch that a row can see are multiplied, not all five. */
            for (uint32_t j = 0; j <= i; ++j) {
                const eits_real *other = fast->moved + (size_t)FAST_NUMBERS * j;
                eits_real sum = 0;
                for (uint32_t k = 0; k < fast->count; ++k)
                    sum += fast_dot(h[k], other + FAST_SIZE * k, FAST_WAYS);
                if (j < i)
                    line[j] = sum;
                else
                    diagonal += sum + error;
            }
        }
        if (n > 0)
            factor_row(fast, i, diagonal);
        else /* the noise alone: the triangle is a diagonal */
            line[i] = eits_sqrt(diagonal);
    }
    eits_copy(fast->white, fast->e, rows);
    for (uint32_t i = 0; i < rows && n == 0; ++i)
        fast->white[i] /= fast_line(fast->factor, i)[i];
    if (n > 0)
        fast_whiten(fast->factor, fast->white, rows);
    return fast_dot(fast->white, fast->white, rows);
}

void eits_fast_update(eits_fast *fast, uint32_t rows)
{
    const uint32_t n = FAST_SIZE * fast->count;
    for (uint32_t i = 0; i < rows; ++i) {
        eits_real *w = fast->moved + (size_t)FAST_NUMBERS * i;
        const eits_real *line = fast_line(fast->factor, i);
        for (uint32_t j = 0; j < i; ++j)
            fast_axpy(w, -line[j], fast->moved + (size_t)FAST_NUMBERS * j, n);
        for (uint32_t k = 0; k < n; ++k)
            w[k] /= line[i];
        fast_axpy(fast->state, fast->white[i], w, n);
        /* Every element of P is written, not one half and its mirror: both halves get the same
         * products in the same order, so that P stays symmetric to the bit. */
        for (uint32_t k = 0; k < n; ++k)
            fast_axpy(fast->p[k], -w[k], w, n);
    }
}

void eits_fast_add(eits_fast *fast, const eits_real *state, const eits_real *variance, eits_real xy)
{
    const uint32_t at = FAST_SIZE * fast->count;
    eits_copy(fast->state + at, state, FAST_SIZE);
    for (uint32_t i = 0; i < FAST_SIZE; ++i) {
        eits_zero(fast->p[at + i], at + FAST_SIZE);
        for (uint32_t j = 0; j < at; ++j)
            fast->p[j][at + i] = 0;
        fast->p[at + i][at + i] = variance[i];
    }
    fast->p[at][at + 1] = fast->p[at + 1][at] = xy;
    fast->known[fast->count++] =
        (fast_known){.id = fast->next_id, .on = 1, .peak = eits_fabs(state[FAST_C])};
    fast->next_id = fast->next_id == UINT32_MAX ? 1 : fast->next_id + 1;
}

void eits_fast_forget(eits_fast *fast, uint32_t k)
{
    const uint32_t from = FAST_SIZE * k, n = FAST_SIZE * fast->count;
    /* The others move up. What they have in common with the touch that goes is lost with it, which
     * leaves the others as sure as they are. */
    for (uint32_t i = from; i + FAST_SIZE < n; ++i) {
        fast->state[i] = fast->state[i + FAST_SIZE];
        eits_copy(fast->p[i], fast->p[i + FAST_SIZE], n);
    }
    for (uint32_t i = 0; i < n; ++i)
        eits_copy(fast->p[i] + from, fast->p[i] + from + FAST_SIZE, n - from - FAST_SIZE);
    for (uint32_t i = k; i + 1 < fast->count; ++i) {
        fast->known[i] = fast->known[i + 1];
        /* Drives remember places by a touch's number, which changes here. */
        for (uint32_t d = 0; d < fast->drives; ++d) {
            fast->drive[d].there[i] = fast->drive[d].there[i + 1];
            eits_copy(fast->drive[d].then[i], fast->drive[d].then[i + 1], FAST_WAYS);
        }
    }
    --fast->count;
    for (uint32_t d = 0; d < fast->drives; ++d)
        fast->drive[d].there[fast->count] = 0;
}

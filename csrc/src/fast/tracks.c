/* Touches followed from drive to drive by an extended Kalman filter.
 *
 * One covariance for all of them, since touches share rows (Bar-Shalom, Li and Kirubarajan,
 * Estimation with Applications to Tracking and Navigation, Wiley 2001, ch. 10). A drive's rows are
 * taken at once: S = H P H' + R = L L', and with M = P H' the update is W = M L'^-1, state + W L^-1
 * e, P - W W'. R keeps S positive although P loses digits in float32; a pivot that is not is the
 * noise's own. */
#include "fast/fast.h"

#include "search/constants.h"

/* F P F' without a matrix product: F adds dt times the speed to a place, so that rows change first,
 * then columns. */
static void carry(eits_fast *fast, uint32_t at, eits_real dt_s)
{
    const uint32_t n = FAST_SIZE * fast->count;
    for (uint32_t axis = 0; axis < 2; ++axis) {
        fast->state[at + axis] += dt_s * fast->state[at + FAST_VX + axis];
        fast_axpy(fast->p[at + axis], dt_s, fast->p[at + FAST_VX + axis], n);
    }
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t axis = 0; axis < 2; ++axis)
            fast->p[i][at + axis] += dt_s * fast->p[i][at + FAST_VX + axis];
    }
}

/* Whether a touch slides: fingers of one hand move together, so that the others may begin to. One
 * that has just landed may have a speed because another lands beside it. */
static int any_slides(const eits_fast *fast)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        const eits_real *speed = fast->state + FAST_SIZE * k + FAST_VX;
        if (fast->known[k].on && fast->known[k].moving && fast->known[k].age > EITS_FAST_YOUNG &&
            speed[0] * speed[0] + speed[1] * speed[1] > fast_square(EITS_FAST_SLIDES))
            return 1;
    }
    return 0;
}

void eits_fast_predict(eits_fast *fast, eits_real dt_s)
{
    const eits_real still_mm = any_slides(fast) ? EITS_FAST_BESIDE_MM : EITS_FAST_STILL_MM;
    /* The noise that comes with time is in proportion to it, whatever the scan's rate. */
    const eits_real drives = dt_s / EITS_FAST_DRIVE_S;
    for (uint32_t k = 0; k < fast->count; ++k) {
        /* A speed is trusted for a few drives that nothing explains; then the touch stays where it
         * is until something does: it may be the speed that is wrong. */
        const int coasts = (fast->unexplained & EITS_FAST_COASTS) != EITS_FAST_COASTS;
        const uint32_t at = FAST_SIZE * k, moving = fast->known[k].moving;
        const uint32_t first = moving ? at + FAST_VX : at + FAST_X;
        const eits_real noise = moving ? EITS_FAST_SPEED_NOISE : still_mm;
        const eits_real strength = EITS_FAST_STRENGTH_NOISE * fast->known[k].peak;
        if (moving && coasts)
            carry(fast, at, dt_s);
        fast->p[first][first] += fast_square(noise) * drives;
        fast->p[first + 1][first + 1] += fast_square(noise) * drives;
        fast->p[at + FAST_C][at + FAST_C] += fast_square(strength) * drives;
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

/* Row i of S's factor, once those before it are known: S_ij less what they have in common. */
static void factor_row(eits_fast *fast, uint32_t i, eits_real diagonal)
{
    /* P loses digits in float32 after thousands of updates. A pivot that is not positive says that
     * the row is already known to its noise. */
    const eits_real pivot = fast_factor_row(fast->factor, i, diagonal);
    fast_line(fast->factor, i)[i] = eits_sqrt(pivot > 0 ? pivot : fast_square(fast->sigma));
}

/* Without a known touch, the rows hold noise alone, and the triangle is a diagonal. */
static eits_real innovate_alone(eits_fast *fast, uint32_t rows)
{
    eits_zero(fast->factor, (size_t)rows * (rows + 1) / 2);
    for (uint32_t i = 0; i < rows; ++i) {
        fast->e[i] = fast->used[i] ? fast->z[i] : 0;
        fast->white[i] = fast->e[i] / fast->sigma;
        fast_line(fast->factor, i)[i] = fast->sigma;
    }
    return fast_dot(fast->white, fast->white, rows);
}

/* P h' of a row: the columns that are not zero, of which a still touch has no speeds. */
static inline void move_row(const eits_fast *fast, eits_real (*h)[3], eits_real *moved)
{
    for (uint32_t l = 0; l < fast->count; ++l) {
        const uint32_t last = FAST_SIZE * l + (fast->known[l].moving ? FAST_SIZE : FAST_WAYS);
        for (uint32_t c = FAST_SIZE * l; c < last; ++c) {
            const eits_real *p = fast->p[0] + c;
            eits_real sum = 0;
            for (uint32_t k = 0; k < fast->count; ++k, p += FAST_SIZE * FAST_NUMBERS) {
                sum = eits_fma(h[k][0], p[0], sum);
                sum = eits_fma(h[k][1], p[FAST_NUMBERS], sum);
                sum = eits_fma(h[k][2], p[2 * FAST_NUMBERS], sum);
            }
            moved[c] = sum;
        }
    }
}

/* chi^2 of what is new in the rows. */
static eits_real whiten_news(eits_fast *fast, uint32_t rows)
{
    eits_copy(fast->white, fast->e, rows);
    fast_whiten(fast->factor, fast->white, rows);
    return fast_dot(fast->white, fast->white, rows);
}

eits_real eits_fast_innovate(eits_fast *fast, uint32_t rows)
{
    const uint32_t n = FAST_SIZE * fast->count;
    if (n == 0)
        return innovate_alone(fast, rows);
    for (uint32_t i = 0; i < rows; ++i) {
        eits_real h[EITS_FAST_MAX_TOUCHES][3];
        eits_real *moved = fast->moved + (size_t)FAST_NUMBERS * i,
                  *line = fast_line(fast->factor, i);
        eits_zero(moved, n);
        eits_zero(line, i);
        fast->e[i] = 0;
        eits_real diagonal = fast_square(fast->sigma);
        if (fast->used[i]) {
            fast->e[i] = fast->z[i] - fast->h[i] - fast->learned[i];
            row_of_h(fast, i, h);
            move_row(fast, h, moved);
            /* S_ij = h_i P h_j', of which P h_j' stands in `moved`: only the three numbers of a
             * touch that a row can see are multiplied, not all five. */
            for (uint32_t j = 0; j <= i; ++j) {
                const eits_real *other = fast->moved + (size_t)FAST_NUMBERS * j;
                eits_real sum = 0;
                for (uint32_t k = 0; k < fast->count; ++k, other += FAST_SIZE)
                    sum += eits_fma(h[k][2], other[2],
                                    eits_fma(h[k][1], other[1], h[k][0] * other[0]));
                if (j < i)
                    line[j] = sum;
                else
                    diagonal += sum + fast->error[i];
            }
        }
        factor_row(fast, i, diagonal);
    }
    return whiten_news(fast, rows);
}

/* After Gill, Golub, Murray and Saunders, Math. Comp. 28 (1974) 505. */
void eits_fast_grow(eits_real *factor, eits_real *x, uint32_t rows)
{
    for (uint32_t k = 0; k < rows; ++k) {
        eits_real *pivot = fast_line(factor, k) + k;
        const eits_real root = eits_sqrt(fast_square(*pivot) + fast_square(x[k]));
        const eits_real c = root / *pivot, s = x[k] / *pivot;
        *pivot = root;
        for (uint32_t i = k + 1; i < rows; ++i) {
            eits_real *below = fast_line(factor, i) + k;
            *below = eits_fma(s, x[i], *below) / c;
            x[i] = eits_fma(-s, *below, c * x[i]);
        }
    }
}

eits_real eits_fast_loosen(eits_fast *fast, uint32_t rows, eits_real share2)
{
    for (uint32_t k = 0; k < fast->count; ++k) {
        const uint32_t c = FAST_SIZE * k + FAST_C;
        const eits_real *answer = fast->answer + FAST_WAYS * (size_t)fast->most_rows * k;
        const eits_real more = share2 * fast_square(fast->known[k].peak), root = eits_sqrt(more);
        fast->p[c][c] += more;
        for (uint32_t i = 0; i < rows; ++i) {
            const eits_real own = fast->used[i] ? answer[i] : 0;
            fast->moved[(size_t)FAST_NUMBERS * i + c] += more * own;
            fast->spare[i] = root * own;
        }
        eits_fast_grow(fast->factor, fast->spare, rows);
    }
    return whiten_news(fast, rows);
}

void eits_fast_update(eits_fast *fast, uint32_t rows)
{
    const uint32_t n = FAST_SIZE * fast->count;
    for (uint32_t i = 0; i < rows && n > 0; ++i) {
        eits_real *w = fast->moved + (size_t)FAST_NUMBERS * i;
        const eits_real *line = fast_line(fast->factor, i);
        for (uint32_t j = 0; j < i; ++j)
            fast_axpy(w, -line[j], fast->moved + (size_t)FAST_NUMBERS * j, n);
        for (uint32_t k = 0; k < n; ++k)
            w[k] /= line[i];
        fast_axpy(fast->state, fast->white[i], w, n);
        for (uint32_t k = 0; k < n; ++k) {
            if (w[k] != 0) /* the speed of a still touch is */
                fast_axpy(fast->p[k], -w[k], w, k + 1);
        }
    }
    for (uint32_t k = 1; k < n; ++k) {
        for (uint32_t l = 0; l < k; ++l)
            fast->p[l][k] = fast->p[k][l];
    }
}

void eits_fast_set_covariance(eits_fast *fast, uint32_t k, eits_real (*covariance)[FAST_SIZE])
{
    const uint32_t at = FAST_SIZE * k, n = FAST_SIZE * fast->count;
    for (uint32_t i = 0; i < FAST_SIZE; ++i) {
        eits_zero(fast->p[at + i], n);
        for (uint32_t j = 0; j < n; ++j)
            fast->p[j][at + i] = 0;
    }
    for (uint32_t i = 0; i < FAST_SIZE; ++i)
        eits_copy(fast->p[at + i] + at, covariance[i], FAST_SIZE);
}

void eits_fast_add(eits_fast *fast, const eits_real *state, eits_real (*covariance)[FAST_SIZE],
                   eits_real energy, eits_real rho2)
{
    const uint32_t k = fast->count++;
    eits_copy(fast->state + (size_t)FAST_SIZE * k, state, FAST_SIZE);
    eits_fast_set_covariance(fast, k, covariance);
    fast->known[k] = (fast_known){.id = eits_fast_id_at(fast, state),
                                  .on = 1,
                                  .peak = state[FAST_C],
                                  .energy = energy,
                                  .rho2 = rho2};
    fast->known[k].moving = covariance[FAST_VX][FAST_VX] > 0;
    fast->born = 1;
}

void eits_fast_put_on(eits_fast *fast, uint32_t k)
{
    fast_known *known = &fast->known[k];
    known->on = 1;
    if (known->off_drives <= EITS_FAST_GONE)
        return;
    known->id = eits_fast_id_at(fast, fast->state + (size_t)FAST_SIZE * k);
    known->confirmed = 0;
}

void eits_fast_still(eits_fast *fast, uint32_t k)
{
    const uint32_t at = FAST_SIZE * k, n = FAST_SIZE * fast->count;
    fast->known[k].moving = fast->known[k].slow = fast->known[k].creeps = 0;
    for (uint32_t speed = at + FAST_VX; speed <= at + FAST_VY; ++speed) {
        fast->state[speed] = 0;
        eits_zero(fast->p[speed], n);
        for (uint32_t i = 0; i < n; ++i)
            fast->p[i][speed] = 0;
    }
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

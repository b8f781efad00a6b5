/* What becomes of drives that no known touch explains: they wait, and a touch is born once its
 * place is sure, explains enough and leaves little, and no other place does nearly as well. */
#include "fast/fast.h"

void eits_fast_wait(eits_fast *fast, uint32_t drive, uint32_t rows, int news)
{
    ++fast->waited;
    const int begins = fast->held_count == 0 || fast->waited > EITS_FAST_MAX_WAIT;
    if (begins) {
        eits_zero(fast->score, fast->cells);
        fast->held_count = fast->waited = fast->last_count = fast->turn = 0;
        fast->stage = FAST_ONE;
    }
    /* Buffers go round: the oldest drive's memory becomes the newest's, and nothing is copied but
     * the small record. */
    if (fast->held_count == EITS_FAST_HELD) {
        const fast_held oldest = fast->held[0];
        for (uint32_t n = 1; n < EITS_FAST_HELD; ++n)
            fast->held[n - 1] = fast->held[n];
        fast->held[--fast->held_count] = oldest; /* its memory */
    }
    fast_held *held = &fast->held[fast->held_count++];
    const uint32_t count = fast->drive[drive].count;
    held->drive = (uint16_t)drive;
    held->rows = (uint16_t)rows;
    held->used = 0;
    for (uint32_t i = 0; i < count; ++i)
        held->used |= (uint32_t)fast->used[i] << i;
    held->sudden = fast_dot(fast->white, fast->white, count) > EITS_FAST_SUDDEN;
    held->alone = fast->count == 0;
    held->said = 0;
    eits_copy(held->white, fast->white, count);
    eits_copy(held->factor, fast->factor, (size_t)count * (count + 1) / 2);
    /* nor where the drive's work is another */
    if (!(begins && held->sudden) && fast->stage != FAST_TWO)
        eits_fast_map(fast, held);
    fast->quiet = news ? 0 : fast->quiet + 1;
}

/* A drive waits no more; its memory goes behind the others'. */
static void drop(eits_fast *fast, uint32_t n)
{
    const fast_held dropped = fast->held[n];
    for (--fast->held_count; n < fast->held_count; ++n)
        fast->held[n] = fast->held[n + 1];
    fast->held[n] = dropped;
}

/* Rows less what has been fitted to them, at least 1. */
static eits_real freedom(const eits_fast *fast, const fast_fit *fit, uint32_t from)
{
    const uint32_t drives = fast->held_count - from, spent = fit->count * (drives + 2);
    uint32_t rows = 0;
    for (uint32_t n = from; n < fast->held_count; ++n)
        rows += fast->held[n].rows;
    return rows > spent ? (eits_real)(rows - spent) : R(1);
}

/* What is left of chi^2 for each degree of freedom, at least 1. A model that is wrong by more than
 * the noise leaves more; all that is believed is then asked for in that proportion. */
static eits_real excess(const eits_fast *fast, const fast_fit *fit, uint32_t from)
{
    const eits_real each = fit->left_all / freedom(fast, fit, from);
    return each > 1 ? each : 1;
}

/* What noise alone leaves of chi^2, and hardly more: its mean is its freedom, its variance twice
 * that. */
static eits_real noise(const eits_fast *fast, const fast_fit *fit, uint32_t from)
{
    const eits_real free = freedom(fast, fit, from);
    return free + EITS_FAST_LEFT_SD * eits_sqrt(2 * free);
}

/* Apart from each other and from touches; one that is off gives way. */
static int is_apart(const eits_fast *fast, const fast_fit *fit)
{
    for (uint32_t i = 0; i < fit->count; ++i) {
        for (uint32_t k = 0; k < fast->count; ++k) {
            if (fast->known[k].on && !fast_apart(fit->place[i], fast->state + FAST_SIZE * k))
                return 0;
        }
    }
    return fit->count == 1 || fast_apart(fit->place[0], fit->place[1]);
}

/* Whether all that is asked of a new touch holds; `inverse` gets that of the normal equations. */
static int is_believed(const eits_fast *fast, const fast_fit *fit, uint32_t from, eits_real lead,
                       eits_real inverse[4][4])
{
    if (!eits_fast_invert((const eits_real(*)[4])fit->h, 2 * fit->count, inverse))
        return 0;
    const eits_real kappa = excess(fast, fit, from);
    for (uint32_t i = 0; i < fit->count; ++i) {
        const eits_real spread = inverse[2 * i][2 * i] + inverse[2 * i + 1][2 * i + 1];
        if (!(fit->own[i] > EITS_FAST_BIRTH * kappa) ||
            !(kappa * spread < fast_square(EITS_FAST_SPREAD_MM)))
            return 0;
    }
    /* Beside noise, a part of what is explained is left by a touch that is no disc; two touches
     * that are explained by one between them leave more. */
    const eits_real most = noise(fast, fit, from) + fast_square(EITS_FAST_BIRTH_ERROR) * fit->score;
    const eits_real clear = EITS_FAST_AMBIGUOUS * fit->own[fit->count - 1];
    return fit->left_all < most && lead > (clear > EITS_FAST_BIRTH ? clear : EITS_FAST_BIRTH) &&
           is_apart(fast, fit);
}

/* Touches where one is born, all of which are off: it is another press. */
static void forget_near(eits_fast *fast, const eits_real *place)
{
    for (uint32_t k = fast->count; k-- > 0;) {
        if (!fast_apart(place, fast->state + FAST_SIZE * k))
            eits_fast_forget(fast, k);
    }
}

static void give_birth(eits_fast *fast, const fast_fit *fit, uint32_t from,
                       const eits_real inverse[4][4])
{
    const eits_real kappa = excess(fast, fit, from);
    const uint32_t drives = fast->held_count - from;
    for (uint32_t i = 0; i < fit->count; ++i) {
        forget_near(fast, fit->place[i]);
        const uint32_t k = fast->count, at = 2 * i;
        const eits_real c = fit->share[fast->held_count - 1].strength[i];
        const eits_real place = fast_square(EITS_FAST_BORN_MM);
        const eits_real speed = fast_square(EITS_FAST_FIRST_SPEED);
        const eits_real state[FAST_SIZE] = {fit->place[i][0], fit->place[i][1], c, 0, 0};
        const eits_real variance[FAST_SIZE] = {
            kappa * inverse[at][at] + place, kappa * inverse[at + 1][at + 1] + place,
            kappa * fit->variance[i] + fast_square(EITS_FAST_BORN_STRENGTH * c), speed, speed};
        eits_fast_add(fast, state, variance, kappa * inverse[at][at + 1]);
        fast->known[k].energy = fit->own[i] / (eits_real)drives;
        for (uint32_t n = 0; n < drives; ++n) {
            fast_drive *d = &fast->drive[fast->held[from + n].drive];
            d->there[k] = d->explained = 1;
            d->then[k][FAST_X] = fit->place[i][0];
            d->then[k][FAST_Y] = fit->place[i][1];
            d->then[k][FAST_C] = fit->share[from + n].strength[i];
        }
    }
    fast->held_count = 0;
}

/* `fit` is born where it is believed: with the first drive that waits or without it, first as it
 * was searched for. */
static int try(eits_fast *fast, const fast_fit *fit, uint32_t from, eits_real lead)
{
    eits_real inverse[4][4];
    int believed = is_believed(fast, fit, from, lead, inverse);
    if (!believed && fit->count == 1) {
        fast_fit *other = &fast->trial;
        *other = *fit;
        fit = other;
        from = 1 - from;
        believed = eits_fast_fit_at(fast, from, from == 0 ? ~1u : ~0u, other) &&
                   is_believed(fast, other, from, lead, inverse);
    }
    if (believed)
        give_birth(fast, fit, from, (const eits_real(*)[4])inverse);
    return believed;
}

/* A drive that spoils the fit alone, not the newest, waits no more; 1 where there was one. */
static int drop_spoiled(eits_fast *fast, const fast_fit *fit, uint32_t from)
{
    uint32_t worst = from;
    /* The newest is kept: it may be the first that a second touch has changed, and the next drives
     * will say. */
    for (uint32_t n = from + 1; n < fast->held_count; ++n)
        worst = fit->share[n].left > fit->share[worst].left ? n : worst;
    const eits_real left = fit->share[worst].left;
    if (!(left > EITS_FAST_NEWS && left > fit->left_all / 2) || worst + 1 >= fast->held_count)
        return 0;
    drop(fast, worst);
    return 1;
}

static int find_one(eits_fast *fast)
{
    /* The first drive that waits may have been measured while a touch landed, and then tells of a
     * wrong place. What comes slowly changes it little, and it is worth as much as the others. */
    const uint32_t from = fast->held[0].sudden;
    eits_real lead;
    const fast_fit *fit = eits_fast_find(fast, from, NULL, &lead);
    fast->stage = FAST_ONE;
    if (fit == NULL)
        return 0;
    if (try(fast, fit, from, lead))
        return 1;
    eits_copy(fast->first, fit->place[0], 2);
    /* The search for a second touch takes two drives, in which the first could have been born. */
    const int more = fit->left_all > noise(fast, fit, from);
    if (!drop_spoiled(fast, fit, from) && fast->held_count > 2 && more)
        fast->stage = FAST_BESIDE;
    return 0;
}

static int find_two(eits_fast *fast)
{
    const uint32_t from =
        fast->held_count > EITS_FAST_PAIR_HELD + 1 ? fast->held_count - EITS_FAST_PAIR_HELD : 1;
    eits_real lead;
    const fast_fit *fit = eits_fast_find(fast, from, fast->first, &lead);
    fast->stage = FAST_ONE;
    return fit != NULL && try(fast, fit, from, lead);
}

int eits_fast_find_births(eits_fast *fast)
{
    const uint32_t room = EITS_FAST_MAX_TOUCHES - fast->count;
    uint32_t unexplained = 0;
    for (uint32_t bits = fast->unexplained; bits != 0; bits &= bits - 1)
        ++unexplained;
    /* With most of the last drives unexplained, rows are faulty or the model is not this skin's:
     * any place would explain something. Whole frames name the fault. */
    if (fast->held_count < 2 || room < 1 || unexplained > EITS_FAST_UNEXPLAINED)
        return 0;
    if (fast->stage == FAST_ONE || room < 2)
        return find_one(fast);
    if (fast->stage == FAST_TWO)
        return find_two(fast);
    eits_fast_map_beside(fast, fast->first);
    eits_fast_keep_up(fast);
    fast->stage = FAST_TWO;
    return 0;
}

/* The pieces of work of a search, in the order of what they cost and how often they decide. Each is
 * wanted or not by what those before it have found. */
#include "search/search.h"

static uint32_t cost_of_map(const eits_fast *fast)
{
    uint32_t open = 0;
    const uint32_t from = fast->search.count - search_last(fast, EITS_FAST_MAP_DRIVES);
    for (uint32_t n = from; n < fast->search.count; ++n)
        open += !fast->ring[fast->search.from + n]->mapped;
    return EITS_FAST_MAP_ANSWERS * open;
}

/* Old drives are forgotten little by little. */
static void run_map(eits_fast *fast)
{
    const uint32_t from = fast->search.count - search_last(fast, EITS_FAST_MAP_DRIVES);
    fast->search.spent += cost_of_map(fast);
    for (uint32_t n = from; n < fast->search.count; ++n) {
        fast_held *held = fast->ring[fast->search.from + n];
        if (held->mapped)
            continue;
        for (uint32_t cell = 0; cell < fast->cells; ++cell)
            fast->score[cell] *= EITS_FAST_MAP_KEPT;
        eits_fast_map(fast, held, NULL, fast->score);
        held->mapped = 1;
    }
}

static const search_piece MAP = {cost_of_map, run_map};

/* Piece `task` of a search; NULL after the last. */
static const search_piece *piece(uint32_t task)
{
    const search_piece *const first[] = {&MAP, &eits_piece_one, &eits_piece_move, &eits_piece_rival,
                                         &eits_piece_more};
    const uint32_t simple = sizeof first / sizeof first[0], changes = 4, births = 7;
    if (task < simple)
        return first[task];
    if (task < simple + changes)
        return &eits_pieces_change[task - simple];
    return task < simple + changes + births ? &eits_pieces_birth[task - simple - changes] : NULL;
}

/* Whether there is work left in this drive for a piece. */
static int has_room(const eits_fast *fast, uint32_t cost)
{
    const fast_search *s = &fast->search;
    return s->spent == 0 || s->spent + cost <= EITS_FAST_ANSWERS;
}

/* The drives that wait, the first of them left out where a touch may have landed within it; 0 where
 * there is nothing to go by. */
static int begin(eits_fast *fast)
{
    fast_search *s = &fast->search;
    uint32_t unexplained = 0;
    for (uint32_t bits = fast->unexplained; bits != 0; bits &= bits - 1)
        ++unexplained;
    /* With most of the last drives unexplained, rows are faulty or the model is not this skin's:
     * any place would explain something. Whole frames name the fault. */
    if (fast->held_count < 2 || unexplained > EITS_FAST_UNEXPLAINED)
        return 0;
    s->count = fast->held_count < EITS_FAST_SEARCHED ? fast->held_count : EITS_FAST_SEARCHED;
    s->from = fast->ring_count - s->count;
    if (fast->ring[s->from]->chi2 > EITS_FAST_SUDDEN) {
        ++s->from;
        --s->count;
    }
    if (s->count < 2)
        return 0;
    for (uint32_t n = 0; n < FAST_WHICH; ++n)
        s->trial[n].exists = 0;
    s->task = 0;
    s->active = 1;
    return 1;
}

int eits_search(eits_fast *fast)
{
    fast_search *s = &fast->search;
    s->spent = s->owed;
    s->owed = 0;
    if (!s->active && !begin(fast))
        return 0;
    /* with one touch nothing else has asked for it */
    if (fast->count == 1 && eits_fast_gather(fast, fast->state, fast->known[0].rho2, &s->disc[0]))
        eits_fast_look(fast, fast->state, fast->known[0].rho2, &s->disc[0], &fast->sight[0]);
    for (const search_piece *next; (next = piece(s->task)) != NULL; ++s->task) {
        const uint32_t cost = next->cost(fast);
        if (cost == 0)
            continue;
        if (!has_room(fast, cost))
            return 0;
        next->run(fast);
    }
    s->active = 0;
    ++s->decisions;
    return eits_decide(fast);
}

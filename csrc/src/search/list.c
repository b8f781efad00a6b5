/* The pieces of work of a search, in the order of what they cost and how often they decide. Each is
 * wanted or not by what those before it have found. */
#include "search/search.h"

/* The next of the last drives that is not in the map yet; NULL where all are. */
static fast_held *next_open(const eits_fast *fast)
{
    const uint32_t count = fast->search.count, most = search_last(fast, EITS_FAST_MAP_DRIVES);
    for (uint32_t n = count - most; n < count; ++n) {
        fast_held *held = fast->ring[fast->search.from + n];
        if (!held->mapped)
            return held;
    }
    return NULL;
}

static uint32_t cost_of_map(const eits_fast *fast)
{
    return next_open(fast) != NULL ? EITS_FAST_MAP_ANSWERS : 0;
}

/* Old drives are forgotten little by little. */
static void add_to_map(eits_fast *fast)
{
    fast_held *held = next_open(fast);
    for (uint32_t cell = 0; cell < fast->cells; ++cell)
        fast->score[cell] *= EITS_FAST_MAP_KEPT;
    eits_fast_map(fast, held, NULL, fast->score);
    held->mapped = 1;
    fast->search.spent += EITS_FAST_MAP_ANSWERS;
}

static const search_piece MAP = {cost_of_map, add_to_map, NULL};

/* Piece `task` of a search; NULL after the last. */
static const search_piece *piece(uint32_t task)
{
    const search_piece *const first[] = {
        &MAP, &MAP, &MAP, &eits_piece_one, &eits_piece_move, &eits_piece_rival, &eits_piece_more};
    _Static_assert(EITS_FAST_MAP_DRIVES == 3, "a piece for each drive of the map");
    const uint32_t simple = sizeof first / sizeof first[0];
    const uint32_t changes = sizeof eits_pieces_change / sizeof eits_pieces_change[0];
    const uint32_t births = sizeof eits_pieces_birth / sizeof eits_pieces_birth[0];
    if (task < simple)
        return first[task];
    if (task < simple + changes)
        return &eits_pieces_change[task - simple];
    return task < simple + changes + births ? &eits_pieces_birth[task - simple - changes] : NULL;
}

/* A look at two touches in all drives of a search costs the most. */
enum { FAST_LOOK = FAST_BODIES * EITS_FAST_SEARCHED };
_Static_assert(FAST_LOOK >= 4 + EITS_FAST_MAX_TOUCHES, "no look at moves costs more");

/* Whether there is work left in this drive for as much. The first piece of a drive always fits: it
 * costs at most FAST_LOOK. */
static int has_room(const eits_fast *fast, uint32_t cost)
{
    return fast->search.spent == 0 || fast->search.spent + cost <= fast->search.most;
}

/* All of the drives that wait, as far as they are searched, are whitened; 0 where that needs
 * another drive. */
static int whiten_all(eits_fast *fast)
{
    const uint32_t count =
        fast->held_count < EITS_FAST_SEARCHED ? fast->held_count : EITS_FAST_SEARCHED;
    for (uint32_t n = fast->ring_count - count; n < fast->ring_count; ++n) {
        const uint32_t cost = 1 + fast->ring[n]->count / 2u;
        if (fast->ring[n]->ready)
            continue;
        if (!has_room(fast, cost))
            return 0;
        eits_fast_whiten_held(fast, fast->ring[n]);
        fast->search.spent += cost;
    }
    return 1;
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
    if (fast->held_count < 2 || unexplained > EITS_FAST_UNEXPLAINED || !whiten_all(fast))
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
    s->task = s->looked = s->steps = 0;
    s->active = 1;
    return 1;
}

/* One piece, or the rest of it; 0 where the next drive must go on. */
static int do_piece(eits_fast *fast, const search_piece *one)
{
    fast_search *s = &fast->search;
    const uint32_t cost = s->looked ? 0 : one->cost(fast);
    if (!s->looked && cost == 0)
        return 1;
    if (!has_room(fast, cost))
        return 0;
    if (!s->looked)
        one->look(fast);
    s->looked = 1;
    while (s->steps > 0) {
        if (!has_room(fast, (uint32_t)s->stepped->bodies * s->stepped->count))
            return 0;
        eits_trial_take_step(fast);
    }
    if (one->end != NULL)
        one->end(fast);
    s->looked = 0;
    return 1;
}

int eits_search(eits_fast *fast)
{
    fast_search *s = &fast->search;
    s->spent = 0;
    const uint32_t own = EITS_FAST_TOUCH_ANSWERS * fast->count;
    s->most = own < EITS_FAST_ANSWERS ? EITS_FAST_ANSWERS - own : 0;
    if (!s->active && !begin(fast))
        return 0;
    /* with one touch nothing else has asked for it */
    if (fast->count == 1 && eits_fast_gather(fast, fast->state, fast->known[0].rho2, &s->disc[0]))
        eits_fast_look(fast, fast->state, fast->known[0].rho2, &s->disc[0], &fast->sight[0]);
    for (const search_piece *next; (next = piece(s->task)) != NULL; ++s->task) {
        if (!do_piece(fast, next))
            return 0;
    }
    s->active = 0;
    ++s->decisions;
    return eits_decide(fast);
}

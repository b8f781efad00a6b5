/* A hypothesis about drives that wait: known touches that have moved, and new touches, at most
 * two together; how it explains them, and what the search for the best one keeps from drive to
 * drive.
 */
#ifndef EITSKIN_SEARCH_TRIAL_H
#define EITSKIN_SEARCH_TRIAL_H

#include "base/vec.h"
#include "eitskin/fast.h"
#include "fast/constants.h"

enum { FAST_BODIES = EITS_FAST_BODIES, FAST_NEW = 2, FAST_FIT = 4 * FAST_BODIES };
enum { FAST_TRIANGLE = FAST_FIT * (FAST_FIT + 1) / 2 };
enum { FAST_NONE = 255 };

/* Pixels along a side of a disc, and of the fields that are kept as numbers. */
enum { FAST_NEAR_SIDE = 7, FAST_NEAR_MOST = 40, FAST_CACHE_SIDE = EITS_FAST_KEPT_SIDE };

/* A pixel of a soft disc: its weight in the answer and in its derivatives. */
typedef struct fast_near {
    uint16_t pixel;
    eits_real weight[3];
} fast_near;

typedef struct fast_disc {
    uint32_t count;
    eits_real sum[3];
    fast_near near[FAST_NEAR_MOST];
} fast_disc;

/* One touch of a hypothesis: a new one (place, speed) or a known one (offset from where it was,
 * speed). */
typedef struct fast_body {
    uint8_t known;      /* which; FAST_NONE: a new one */
    uint8_t numbers;    /* 4, or 2: it has no speed */
    eits_real p[4];     /* mm, mm, mm/s, mm/s */
    eits_real tight[2]; /* inverse variances of their priors about 0: of a known one's offset, and
                           of a speed */
} fast_body;

typedef struct fast_trial {
    uint8_t exists;
    uint8_t as_known;      /* its bodies are still where the known touches were */
    uint8_t bodies, fresh; /* the known ones come first; `fresh` of them are new */
    uint8_t from, count;   /* which drives of the search it explains */
    uint8_t gone;          /* a known touch that is not there; FAST_NONE: all are */
    eits_real rho2;        /* of the new ones */
    fast_body body[FAST_BODIES];
    eits_real strength[EITS_FAST_HELD][FAST_NEW]; /* in each drive */
    eits_real variance[FAST_NEW];                 /* in the last one */
    eits_real all, left;     /* chi^2 of the drives without it, and with it and its priors */
    eits_real own[FAST_NEW]; /* what each new one explains beside the other */
    eits_real change;        /* what known strengths would have changed, as a cost */
    eits_real b[FAST_FIT], h[FAST_TRIANGLE]; /* normal equations */
    eits_real cost, lead;
} fast_trial;

/* Hypotheses of a search: known ones move; one new touch and its rival; a known one is elsewhere or
 * wider; one new touch without the first drive, or in motion; two new ones and their rival; a young
 * touch was two; one is new while others move; known ones move, by the last drives alone. */
typedef enum fast_which {
    FAST_MOVE,
    FAST_ONE,
    FAST_RIVAL,
    FAST_REPLACE,
    FAST_LATE,
    FAST_SWIFT,
    FAST_PAIR,
    FAST_PAIR_RIVAL,
    FAST_SPLIT,
    FAST_BOTH,
    FAST_LAST,
    FAST_WHICH
} fast_which;

typedef struct fast_search {
    uint32_t active, task, looked; /* looked: its task has begun */
    uint32_t spent, most;          /* of this drive's work, and how much it may be */
    uint32_t from, count;          /* drives of the ring that are explained */
    uint32_t decisions;            /* searches that ended, ever */
    fast_trial trial[FAST_WHICH], scratch, next;
    fast_trial *stepped; /* is made better, in so many steps more */
    uint32_t steps;
    eits_real shorter;
    eits_real before; /* what the one new touch left before its last steps */
    eits_real alone;  /* what moves leave without the new touch beside them; below 0: not known */
    fast_disc disc[FAST_BODIES];
    /* for the present drive: answers of bodies, how their numbers change it; fields at bodies */
    eits_real *ways, *column, *fields, *rest;
    eits_real *pair_score; /* by cell: what a second touch there would explain beside a first */
    eits_real peak[2];     /* of the map */
    eits_real warm[2][2], pair[2][2]; /* places that the last searches came to */
    uint32_t warm_at, warm_count, pair_at, pair_known;
    /* the birth that the last decision would have made */
    eits_real last[FAST_NEW][2];
    uint32_t last_count, last_times, last_at;
} fast_search;

#endif

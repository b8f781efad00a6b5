/* A hypothesis about the drives that wait (at most two touches that have moved or are new, and how
 * well they explain the drives), and the state of a search, which lasts over several drives.
 */
#ifndef EITSKIN_SEARCH_TRIAL_H
#define EITSKIN_SEARCH_TRIAL_H

#include "base/vec.h"
#include "eitskin/fast.h"
#include "fast/constants.h"

enum { FAST_BODIES = EITS_FAST_BODIES, FAST_NEW = 2, FAST_FIT = 4 * FAST_BODIES };
enum { FAST_TRIANGLE = FAST_FIT * (FAST_FIT + 1) / 2 };
enum { FAST_NONE = 255 };

/* Pixels along a side of a disc, the most pixels of a disc, and pixels along a side of the fields
 * that are kept unpacked. */
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

/* One touch of a hypothesis. The parameters of a new touch are place and speed; those of a known
 * touch are the offset from its former place and its speed. */
typedef struct fast_body {
    uint8_t known;      /* number of the known touch; FAST_NONE: a new one */
    uint8_t numbers;    /* parameters: 4, or 2 without speed */
    eits_real p[4];     /* mm, mm, mm/s, mm/s */
    eits_real tight[2]; /* inverse variances of the priors about 0 for a known touch's offset and
                           for a speed */
} fast_body;

typedef struct fast_trial {
    uint8_t exists;
    uint8_t as_known;      /* its bodies are still where the known touches were */
    uint8_t bodies, fresh; /* the known ones come first; `fresh` of them are new */
    uint8_t from, count;   /* the drives of the search that it explains */
    uint8_t gone;          /* a known touch that is assumed to be gone; FAST_NONE: none */
    eits_real rho2;        /* square of the new touches' soft radius, mm^2 */
    fast_body body[FAST_BODIES];
    eits_real strength[EITS_FAST_HELD][FAST_NEW]; /* in each drive */
    eits_real variance[FAST_NEW];                 /* in the last one */
    eits_real all, left;     /* chi^2 of the drives: without the trial; with it, plus its priors */
    eits_real own[FAST_NEW]; /* the part of chi^2 that each new touch explains beside the other */
    eits_real change;        /* cost of the changes of known strengths that the trial implies */
    eits_real b[FAST_FIT], h[FAST_TRIANGLE]; /* normal equations */
    eits_real cost, lead;
} fast_trial;

/* The hypotheses of a search, in this order: known touches move; one new touch; its rival at
 * another place; a known touch is elsewhere or wider; one new touch, without the first drive; one
 * new touch in motion; two new touches; their rival; a young touch was two touches; one new touch
 * while known ones move; known touches move, by the last drives alone. */
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
    uint32_t active, task, looked; /* looked: the look of the present task is done */
    uint32_t spent, most;          /* work done in this drive, and its limit, in answers */
    uint32_t from, count;          /* the drives of the ring that the search explains */
    uint32_t decisions;            /* number of searches that have ended */
    fast_trial trial[FAST_WHICH], scratch, next;
    fast_trial *stepped; /* the trial that is being refined, and how many steps are left */
    uint32_t steps;
    eits_real shorter;
    eits_real before; /* chi^2 that the one new touch left before its last steps */
    eits_real alone;  /* chi^2 that the moves leave without the new touch beside them; below 0: not
                         known */
    fast_disc disc[FAST_BODIES];
    /* for the present drive: answers of the bodies, their derivatives by the parameters, fields at
     * the bodies, and the residual */
    eits_real *ways, *column, *fields, *rest;
    eits_real *pair_score; /* for each cell: the part that a second touch there would explain beside
                              the first */
    eits_real peak[2];     /* greatest cell of the map, mm */
    eits_real warm[2][2], pair[2][2]; /* places that the last searches found */
    uint32_t warm_at, warm_count, pair_at, pair_known;
    uint32_t split_at;      /* the decision after the last split; 0: none */
    uint32_t warm_explains; /* whether the first of them left the last search's drives no more than
                               noise */
    /* the new touches that the last decision would have added */
    eits_real last[FAST_NEW][2];
    uint32_t last_count, last_times, last_at;
} fast_search;

#endif

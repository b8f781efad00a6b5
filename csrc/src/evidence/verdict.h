/* One hypothesis's answer, and what is known of each disc of it: shared by the files that test
 * touches. */
#ifndef EITSKIN_VERDICT_H
#define EITSKIN_VERDICT_H

#include "evidence/evidence.h"

typedef struct verdict {
    eits_answer answer;
    eits_real log_determinant; /* of Sigma */
    eits_real here;            /* F of the discs as they are */
    eits_real rise[EITS_MAX_TOUCHES];
    eits_real place_mm2[EITS_MAX_TOUCHES][3];
    eits_real best_mm[EITS_MAX_TOUCHES][2]; /* where the linearisation has the disc */
    eits_real pair[EITS_MAX_TOUCHES];       /* log odds that it is two (pair.c) */
    eits_real line[EITS_MAX_TOUCHES][2];    /* on which two in its place would lie */
    int drift;                              /* 1: of a sheet that has drifted */
    int changed;                            /* 1: discs were dropped or split */
    int fitted;                             /* 1: in Sigma's metric */
} eits_verdict;

static inline uint32_t eits_columns_of(const eits_answer *answer)
{
    return answer->count * answer->parameters;
}

/* verdict.c */

/* How much worse `count` discs that leave `misfit` fit than Sigma says; at least 1. */
eits_real eits_excess(const eits_context *ctx, eits_real misfit, uint32_t count);

/* What F is to rise by without a touch. */
eits_real eits_needed_rise(const eits_context *ctx, const eits_verdict *v);

/* Whether the data are explained about as well as Sigma says. */
int eits_fits(const eits_context *ctx, const eits_verdict *v);

/* Set what is known of each disc by the linearisation. Returns the weakest. */
uint32_t eits_look(const eits_context *ctx, const eits_scratch *scratch, eits_verdict *v,
                   const eits_likelihood *likelihood);

/* Rises of the answer's discs; returns the weakest. */
uint32_t eits_weakest(const eits_scratch *scratch, const eits_answer *answer,
                      const eits_likelihood *likelihood, eits_real *rise);

/* elimination.c */

/* From the discs as they are to those that stay, under the present covariance; not `to_the_end`: 0
 * as soon as the data are found not to fit, to be gone on with another time, and where no column
 * may be made at all. Where no more may be made, what stands then stays. */
int eits_eliminate(eits_context *ctx, const eits_scratch *scratch, eits_verdict *v, int to_the_end,
                   uint64_t *macs);

#endif

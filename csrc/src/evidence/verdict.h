/* The answer of one hypothesis, and the test's results for each of its discs: shared by the files
 * that test touches. */
#ifndef EITSKIN_VERDICT_H
#define EITSKIN_VERDICT_H

#include "evidence/evidence.h"

typedef struct verdict {
    eits_answer answer;
    eits_real log_determinant; /* of Sigma */
    eits_real here;            /* F of the discs as they are */
    eits_real rise[EITS_MAX_TOUCHES];
    eits_real place_mm2[EITS_MAX_TOUCHES][3];
    eits_real best_mm[EITS_MAX_TOUCHES][2]; /* the place that the linearisation gives to the disc */
    eits_real pair[EITS_MAX_TOUCHES];       /* log odds that it is two (pair.c) */
    eits_real line[EITS_MAX_TOUCHES]
                  [2]; /* direction of the line on which two discs in its place would lie */
    int drift;         /* 1: under the hypothesis that the skin has drifted */
    int changed;       /* 1: discs were dropped or split */
    int fitted;        /* 1: the discs were fitted in Sigma's metric */
} eits_verdict;

static inline uint32_t eits_columns_of(const eits_answer *answer)
{
    return answer->count * answer->parameters;
}

/* verdict.c */

/* Return the excess of `count` discs that leave `misfit`: the misfit over its expectation by Sigma,
 * at least 1. */
eits_real eits_excess(const eits_context *ctx, eits_real misfit, uint32_t count);

/* Return the least rise of F without a disc for which the disc is a touch. */
eits_real eits_needed_rise(const eits_context *ctx, const eits_verdict *v);

/* Return 1 if the data are explained about as well as Sigma predicts. */
int eits_fits(const eits_context *ctx, const eits_verdict *v);

/* Set the results for each disc from the linearisation. Returns the number of the weakest disc. */
uint32_t eits_look(const eits_context *ctx, const eits_scratch *scratch, eits_verdict *v,
                   const eits_likelihood *likelihood);

/* Compute the rises of the answer's discs. Returns the number of the weakest disc. */
uint32_t eits_weakest(const eits_scratch *scratch, const eits_answer *answer,
                      const eits_likelihood *likelihood, eits_real *rise);

/* elimination.c */

/* Eliminate discs until only touches remain, under the present covariance, and return 1. With
 * `to_the_end` 0, return 0 as soon as the data turn out not to fit; the caller may continue later.
 * Also return 0 if not even the first column may be computed. If the budget ends in between, the
 * discs that remain then stay. */
int eits_eliminate(eits_context *ctx, const eits_scratch *scratch, eits_verdict *v, int to_the_end,
                   uint64_t *macs);

#endif

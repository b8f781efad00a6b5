/* A hand on a skin, synthetic: up to three fingers wander, press and lift; voltages that the model
 * itself would give, drift and noise. By basic operations in a fixed order, so that host and board
 * see the same frames. */
#ifndef EITSKIN_SOAK_HAND_H
#define EITSKIN_SOAK_HAND_H

#include "eitskin/context.h"

enum { MAX_ROWS = 512, MAX_FOLDED = 256, MAX_RANK = 128, FINGERS = 3 };

typedef struct hand {
    const eits_model *model;
    eits_real factor[MAX_RANK][MAX_RANK]; /* Cholesky's, of P P' */
    eits_real untouched[MAX_ROWS];        /* the untouched skin, V */
    eits_real rms;                        /* of that */
    uint32_t random;
} hand;

/* 0 where the model is too large for the arrays above. */
int hand_begin(hand *h, const eits_model *model);

/* A whole number from 0 to below `count`, from the hand's own sequence. */
uint32_t hand_draw(hand *h, uint32_t count);

/* Frame number k, V: the fingers as they are then on a skin whose gain is `gain`; with `touched` 0
 * nothing but noise. */
void hand_frame(hand *h, uint64_t k, eits_real gain, int touched, eits_real *frame);

#endif

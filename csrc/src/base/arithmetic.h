/* The arithmetic that the bits of every result rest on: each operation rounded once, to eits_real,
 * in the order written. What a compiler says of its flags is checked here; contraction and
 * re-association it does not say, so eits_init tries them. */
#ifndef EITSKIN_ARITHMETIC_H
#define EITSKIN_ARITHMETIC_H

#include "eitskin/types.h"

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "the core must be compiled without -ffast-math and -ffinite-math-only"
#endif
/* 0: each operation in the width of its operands; 1: float as double, which is none to double */
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0
#if !defined(EITS_DOUBLE) || __FLT_EVAL_METHOD__ != 1
#error "the core must be compiled without excess precision; on x86 use -msse2 -mfpmath=sse"
#endif
#endif

/* Trials, in this order: contraction, another order of sums, another rounding
 * than to nearest, subnormal numbers taken for zero. */
enum { EITS_ARITHMETIC_TRIALS = 4 };

/* Each computed as the core was compiled, and 0 where arithmetic is as written: what is left of
 * (1 + e)^2 - (1 + 2e) with e^2 below half a unit in the last place; of (1/e^2 + 1) - 1/e^2; of
 * 1 + 3/4 unit - (1 + unit); of twice half the least normal number, less that number. */
void eits_try_arithmetic(eits_real left[EITS_ARITHMETIC_TRIALS]);

/* EITS_E_ARITHMETIC where one is not 0. */
eits_status eits_judge_arithmetic(const eits_real left[EITS_ARITHMETIC_TRIALS]);

#endif

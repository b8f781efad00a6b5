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

/* What is left of (1 + e)^2 - (1 + 2e) with e^2 below half a unit in the last place, and of (1/e^2
 * + 1) - 1/e^2, computed as the core was compiled: 0 and 0, but for a compiler that makes a product
 * and a sum one operation, or changes the order of sums. */
void eits_try_arithmetic(eits_real *contracted, eits_real *reordered);

/* EITS_E_ARITHMETIC where either is not 0. */
eits_status eits_judge_arithmetic(eits_real contracted, eits_real reordered);

#endif

/* The bits of every result rest on this arithmetic: each operation is rounded once, to eits_real,
 * in the order written. Every source file that computes includes this header. The preprocessor
 * checks the flags that a compiler reports. A product and a sum are not contracted to a fused
 * multiply-add where a pragma forbids it; clang ignores the pragma under -ffp-contract=fast.
 * Contraction and re-association by other flags are not reported, so eits_init tries them. */
#ifndef EITSKIN_ARITHMETIC_H
#define EITSKIN_ARITHMETIC_H

#include "eitskin/types.h"

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "the core must be compiled without -ffast-math and -ffinite-math-only"
#endif
/* 0: each operation has the width of its operands; 1: float is computed as double, which does not
 * affect double */
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0
#if !defined(EITS_DOUBLE) || __FLT_EVAL_METHOD__ != 1
#error "the core must be compiled without excess precision; on x86 use -msse2 -mfpmath=sse"
#endif
#endif

/* GCC contracts by default. EITS_CONTRACTION_OFF: the flags of the build forbid it already, as in
 * cmake/EitskinCore.cmake. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && !defined(EITS_CONTRACTION_OFF)
#pragma GCC optimize("fp-contract=off", "no-math-errno")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

/* The trials, in this order: contraction, a changed order of sums, a rounding mode other than to
 * nearest, subnormal numbers flushed to zero, and fused multiply-adds that are rounded twice. */
enum { EITS_ARITHMETIC_TRIALS = 5 };

/* Compute the trials with the core's compiler flags. Each is 0 if the arithmetic is plain IEEE: (1
 * + e)^2 - (1 + 2e) with e^2 below half a unit in the last place; (1/e^2 + 1) - 1/e^2; 1 + 3/4 unit
 * - (1 + unit); twice half the least normal number, less that number; n (2^p + 1) / n + 2^-60 -
 * (2^p + 2), where 2^p + 1 lies halfway between two numbers. */
void eits_try_arithmetic(eits_real left[EITS_ARITHMETIC_TRIALS]);

/* Returns EITS_E_ARITHMETIC if one of them is not 0. */
eits_status eits_judge_arithmetic(const eits_real left[EITS_ARITHMETIC_TRIALS]);

#endif

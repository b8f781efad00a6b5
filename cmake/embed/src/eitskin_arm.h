/* Whether the kernels of m7.c run: on an Arm microcontroller with a single-precision FPU. */
#ifndef EITSKIN_ARM_H
#define EITSKIN_ARM_H
#if defined(__GNUC__) && defined(__thumb2__) && defined(__ARM_FEATURE_FMA) && defined(__ARM_FP) && \
    defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M' && !defined(EITS_DOUBLE)
#define EITS_BUILD_M7
#endif
#endif

/* The phase of the voltages, and voltages from amplitudes and phases.
 *
 * After demodulation one angle is left, which all rows share: it comes from the generator's initial
 * phase, the cables and the skin. So the voltages lie on a line through zero in the complex plane,
 * and its direction is half the argument of the sum of z^2. The model decides which end of the line
 * is positive: folded voltages correlate positively with its reference. */
#ifndef FW_PHASE_H
#define FW_PHASE_H

#include "app/solve/engine.h"

/* Learn the angle from the frame's measured rows without a fault. If there are none, the angle
 * stays. */
void fw_phase_learn(fw_engine *engine, const fw_frame *frame);

/* Compute the volts of each measured row. */
void fw_phase_apply(const fw_engine *engine, fw_frame *frame);

#endif

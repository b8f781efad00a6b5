/* The phase of the voltages, and voltages from amplitudes and phases.
 *
 * What the demodulator leaves is one angle for all rows: where the generator's phase began, cables,
 * and what the skin adds. Voltages lie on a line through zero in the complex plane: its direction
 * is half the argument of the sum of z^2. Which of the line's two ends is positive follows from the
 * model: folded voltages correlate positively with its reference. */
#ifndef FW_PHASE_H
#define FW_PHASE_H

#include "app/solve/engine.h"

/* Learn the angle from the frame's measured rows without a fault; with nothing to learn from, it
 * stays. */
void fw_phase_learn(fw_engine *engine, const fw_frame *frame);

/* Volts of each measured row. */
void fw_phase_apply(const fw_engine *engine, fw_frame *frame);

#endif

/* The core on a board: the open model, its options and its reference. */
#ifndef FW_SOLVE_H
#define FW_SOLVE_H

#include "app/acquire/frame.h"
#include "eitskin/eitskin.h"
#include "hal/hal.h"

typedef struct fw_solve fw_solve;
typedef struct fw_safety fw_safety;
typedef struct fw_acquire fw_acquire;

/* Initialise the module; no model is open afterwards. */
void fw_solve_init(fw_solve *solve, const fw_board *board, fw_safety *safety, fw_acquire *acquire);

/* Returns the open model, or NULL. */
const eits_model *fw_solve_model(const fw_solve *solve);

/* Return the rows that the scan measures for the open model, and its two frames. */
fw_scan_table fw_solve_table(const fw_solve *solve);
fw_frame *fw_solve_frames(fw_solve *solve);

/* Returns whether there is a reference. */
bool fw_solve_tared(const fw_solve *solve);

/* Call this when the settings of the scan have changed: the reference and the phase are no longer
 * valid. */
void fw_solve_scan_changed(fw_solve *solve);

/* Call this when the generator's phase has changed; the reference stays. */
void fw_solve_phase_changed(fw_solve *solve);

/* Get and set the options of the open model. */
const eits_options *fw_solve_options(const fw_solve *solve);
eits_status fw_solve_set_options(fw_solve *solve, const eits_options *options);
void fw_solve_mask_row(fw_solve *solve, uint32_t row, bool masked);
const float *fw_solve_image(const fw_solve *solve);

/* Run the open model's golden frame. `difference`: of its image; 0 if it has the same bits. Errors:
 * as fw_engine_self_test. */
eits_status fw_solve_self_test(fw_solve *solve, float *difference);

/* Returns a difference as it is sent in a reply: in billionths, at most 2e9. */
static inline int32_t fw_billionths(float difference)
{
    return (int32_t)(1e9f * (difference < 2 ? difference : 2));
}

uint32_t fw_solve_outliers(const fw_solve *solve);
uint32_t fw_solve_frames_solved(const fw_solve *solve);
bool fw_solve_touched(const fw_solve *solve);
uint32_t fw_solve_workspace_used(const fw_solve *solve);

#endif

/* The open model, the core's context and the frames, laid out in the board's workspace. */
#ifndef FW_ENGINE_H
#define FW_ENGINE_H

#include "app/acquire/frame.h"
#include "eitskin/eitskin.h"
#include "hal/hal.h"

/* The reference and its settings, to be restored after a tare that fails or a self-test. */
typedef struct fw_saved {
    uint8_t *core; /* written by eits_save, at the workspace's end */
    float cosine, sine;
    bool tared, phase_known;
    bool before_tare; /* it is the reference before the last tare, which can be undone */
} fw_saved;

typedef struct fw_engine {
    uint8_t *workspace;
    size_t workspace_bytes, used_bytes; /* used by the open model */
    eits_model model;
    eits_context *ctx; /* at the workspace's start; valid while a model is open */
    bool open, tared;
    float noise_floor_v; /* from the steps of the converter */
    bool phase_known;    /* learned at a tare; otherwise it is estimated from each frame */
    float cosine, sine;  /* of the phase of the voltages */
    fw_frame frames[2];
    uint16_t *unique; /* one row of each reciprocal pair, and rows without a pair */
    uint32_t n_unique;
    uint8_t *flags; /* n_rows: 1 if the present frame has measured the row */
    fw_saved saved;
    /* touches after each drive, and an aligned frame; NULL if the model has no fields, or if memory
     * is short */
    eits_fast *fast;
    float *aligned;     /* n_rows */
    uint16_t *drive_of; /* n_rows: the drive of each row, as `fast` numbers them */
    size_t fast_bytes;
} fw_engine;

void fw_engine_init(fw_engine *engine, void *workspace, size_t workspace_bytes);

/* Returns the workspace that a model needs, including its frames, in bytes. */
size_t fw_engine_needs(const eits_model *model);

/* Use an open model, which is copied, with its default options and tracking. There is no reference
 * yet; the model that was open before is closed. Errors: those of eits_init; EITS_E_WORKSPACE if
 * memory is short. No model is open then. */
eits_status fw_engine_open(fw_engine *engine, const eits_model *model);
void fw_engine_close(fw_engine *engine);

/* Set the least noise of a row, in volts, for the open model and for models that are opened later.
 */
void fw_engine_set_noise_floor(fw_engine *engine, float volts);

/* Returns the table that the scan measures. */
fw_scan_table fw_engine_table(const fw_engine *engine);

/* Save and restore the reference, options, masks and angle. Restoring forgets the warm start. */
void fw_engine_save(fw_engine *engine);
void fw_engine_restore(fw_engine *engine);

/* Run the golden frame of `model`, which may differ from the open one; if it does, the scan must
 * have been stopped. Afterwards the open model is as before, except that the warm start is
 * forgotten. Its reference is lost if memory is too short to keep it beside `model`. Errors:
 * EITS_E_WORKSPACE, those of eits_self_test. */
eits_status fw_engine_self_test(fw_engine *engine, const eits_model *model, float *difference);

#endif

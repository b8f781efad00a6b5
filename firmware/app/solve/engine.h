/* The solver on a board: the model that is open, the core's context, and the frames, laid out in
 * the board's workspace. */
#ifndef FW_ENGINE_H
#define FW_ENGINE_H

#include "app/acquire/scan.h"
#include "eitskin/eitskin.h"
#include "hal/hal.h"

/* What a reference and its settings are, apart from the context: to go back to when a tare or a
 * self-test fails. */
typedef struct fw_saved {
    uint8_t *core; /* eits_save's, at the workspace's end */
    float cosine, sine;
    bool tared, phase_known;
} fw_saved;

typedef struct fw_engine {
    uint8_t *workspace;
    size_t workspace_bytes, used_bytes; /* used by the open model */
    eits_model model;
    eits_context *ctx; /* at the workspace's start; of no use while none is open */
    bool open, tared;
    float noise_floor_v; /* of the scan: its converter's steps */
    bool phase_known;    /* learned at a tare; else it is estimated from each frame */
    float cosine, sine;  /* of the angle that the voltages' phase has */
    fw_frame frames[2];
    uint16_t *unique; /* rows that are no other's reciprocal */
    uint32_t n_unique;
    uint8_t *flags; /* n_rows: bits of the frame under way */
    fw_saved saved;
    /* touches after each drive, and a frame brought to one instant; NULL where the model has no
     * fields, or memory is short */
    eits_fast *fast;
    float *aligned;     /* n_rows */
    uint16_t *drive_of; /* n_rows: fast's number of each row's drive */
    size_t fast_bytes;
} fw_engine;

void fw_engine_init(fw_engine *engine, void *workspace, size_t workspace_bytes);

/* Workspace that a model needs here, frames included. */
size_t fw_engine_needs(const eits_model *model);

/* Take up an open model (copied) with its default options and tracking; not tared. Whatever was
 * open is forgotten. Errors: those of eits_init; EITS_E_WORKSPACE where memory is short; nothing is
 * open then. */
eits_status fw_engine_open(fw_engine *engine, const eits_model *model);
void fw_engine_close(fw_engine *engine);

/* No row has less noise than this, in volts: for the open model and those that are opened later. */
void fw_engine_set_noise_floor(fw_engine *engine, float volts);

/* The table that the scan measures. */
fw_scan_table fw_engine_table(const fw_engine *engine);

/* Keep reference, options, masks and angle; restore puts them back, the warm start forgotten. */
void fw_engine_save(fw_engine *engine);
void fw_engine_restore(fw_engine *engine);

/* Run the golden frame of `model`, which may be another than the open one; scanning may go on only
 * if it is the open one. Afterwards the open model is as before but for the warm start; its tare is
 * lost only where memory is too short to keep it beside `model`. Errors: EITS_E_WORKSPACE, those of
 * eits_self_test. */
eits_status fw_engine_self_test(fw_engine *engine, const eits_model *model, float *difference);

#endif

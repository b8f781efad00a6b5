/* The state of the solve module. Besides its own files only app/instrument.h may include this file.
 */
#ifndef FW_SOLVE_STATE_H
#define FW_SOLVE_STATE_H

#include "app/solve/engine.h"
#include "app/solve/store.h"

typedef struct fw_models {
    fw_record record; /* of the open model's bank */
    uint32_t bank;
    eits_status why_none; /* why the newest model could not be opened */
} fw_models;

typedef struct fw_tare {
    bool active;
    uint32_t request, wanted, taken, refused;
    uint32_t since_us; /* frames whose scan began earlier do not count as untouched */
} fw_tare;

/* Touches after each drive. The volatile fields are shared with the work of interrupts. */
typedef struct fw_tracker {
    volatile bool owed;              /* drives wait until frame number owed_frame is aligned */
    volatile bool at_frame;          /* the main loop has a frame */
    bool running;                    /* no drive was left out since `begun` */
    uint32_t owed_frame, begun;      /* numbers of frames */
    uint32_t next_first, next_frame; /* of the next drive */
    bool noted;                      /* `touches` are news to the tracker */
    uint32_t count;
    eits_touch touches[EITS_MAX_TOUCHES]; /* touches that the solver found in its last frame */
} fw_tracker;

struct fw_solve {
    const fw_board *board;
    struct fw_safety *safety;
    struct fw_acquire *acquire;
    fw_engine engine;
    fw_models models;
    fw_tare tare;
    fw_tracker tracker;
    uint32_t disagreeing, agreeing; /* consecutive frames, by their reciprocal rows */
    uint32_t outliers;              /* rows, of all frames that the core has looked at */
    uint32_t frames_solved;
    bool touched; /* the last solved frame had a touch */
};

#endif

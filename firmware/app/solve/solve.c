#include "app/solve/solve.h"

#include "app/acquire/acquire.h"
#include "app/solve/state.h"

void fw_solve_init(fw_solve *solve, const fw_board *board, fw_safety *safety, fw_acquire *acquire)
{
    *solve = (fw_solve){.board = board, .safety = safety, .acquire = acquire};
    fw_engine_init(&solve->engine, board->workspace, board->workspace_bytes);
    fw_engine_set_noise_floor(&solve->engine, fw_acquire_noise_floor_v(acquire));
}

const eits_model *fw_solve_model(const fw_solve *solve)
{
    return solve->engine.open ? &solve->engine.model : NULL;
}

fw_scan_table fw_solve_table(const fw_solve *solve)
{
    return fw_engine_table(&solve->engine);
}

fw_frame *fw_solve_frames(fw_solve *solve)
{
    return solve->engine.frames;
}

bool fw_solve_tared(const fw_solve *solve)
{
    return solve->engine.tared;
}

void fw_solve_scan_changed(fw_solve *solve)
{
    fw_engine_set_noise_floor(&solve->engine, fw_acquire_noise_floor_v(solve->acquire));
    solve->engine.tared = solve->engine.phase_known = false;
    solve->engine.saved.before_tare = false;
}

void fw_solve_phase_changed(fw_solve *solve)
{
    solve->engine.phase_known = false;
}

const eits_options *fw_solve_options(const fw_solve *solve)
{
    return eits_get_options(solve->engine.ctx);
}

eits_status fw_solve_set_options(fw_solve *solve, const eits_options *options)
{
    return eits_set_options(solve->engine.ctx, options);
}

void fw_solve_mask_row(fw_solve *solve, uint32_t row, bool masked)
{
    (void)eits_mask_row(solve->engine.ctx, row, masked);
    solve->engine.saved.before_tare = false;
}

const float *fw_solve_image(const fw_solve *solve)
{
    return eits_get_image(solve->engine.ctx);
}

eits_status fw_solve_self_test(fw_solve *solve, float *difference)
{
    const eits_model model = solve->engine.model;
    return fw_engine_self_test(&solve->engine, &model, difference);
}

uint32_t fw_solve_outliers(const fw_solve *solve)
{
    return solve->outliers;
}

uint32_t fw_solve_frames_solved(const fw_solve *solve)
{
    return solve->frames_solved;
}

bool fw_solve_touched(const fw_solve *solve)
{
    return solve->touched;
}

uint32_t fw_solve_workspace_used(const fw_solve *solve)
{
    return (uint32_t)solve->engine.used_bytes;
}

#include "app/safety/safety.h"

#include "app/safety/state.h"

void fw_safety_init(fw_safety *safety, const fw_board *board, fw_safety_hooks hooks)
{
    *safety = (fw_safety){.board = board,
                          .owner = fw_owner_record_load(&board->store),
                          .fault_changed = hooks.fault_changed,
                          .current_changed = hooks.current_changed,
                          .user = hooks.user};
}

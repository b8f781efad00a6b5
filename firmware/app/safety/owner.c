#include "app/safety/owner.h"

#include "app/safety/faults.h"
#include "app/safety/state.h"

uint32_t fw_owner_settings(const fw_safety *safety)
{
    return safety->owner.settings;
}

bool fw_owner_keeps_current(const fw_safety *safety)
{
    return (safety->owner.settings & EITS_SETTING_KEEP_CURRENT) != 0;
}

uint32_t fw_owner_current_limit_ua(const fw_safety *safety)
{
    return safety->owner.current_limit_ua_rms;
}

bool fw_owner_refuses(fw_safety *safety, eits_packet_type command)
{
    const fw_board *board = safety->board;
    if ((safety->owner.settings & EITS_SETTING_LOCKED) == 0 ||
        (board->system->button != NULL && board->system->button(board->system_ctx)))
        return false;
    fw_fault_set(safety, EITS_FAULT_LOCKED, true, (fw_fault_detail){.index = (int32_t)command});
    return true;
}

fw_status fw_owner_save(fw_safety *safety, uint32_t settings, uint32_t current_limit_ua_rms)
{
    const fw_store *store = &safety->board->store;
    const fw_status status = fw_owner_record_save(store, settings, current_limit_ua_rms);
    if (status == FW_OK)
        safety->owner = fw_owner_record_load(store);
    return status;
}

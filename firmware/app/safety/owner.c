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

const char *fw_owner_name(const fw_safety *safety)
{
    return safety->owner.name;
}

static bool letter_or_digit(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

bool fw_owner_name_valid(const char *name)
{
    uint32_t length = 0;
    while (length < EITS_NAME_CHARACTERS &&
           (letter_or_digit(name[length]) ||
            (length > 0 && (name[length] == '-' || name[length] == '_'))))
        ++length;
    while (length < EITS_NAME_CHARACTERS && name[length] == 0)
        ++length;
    return length == EITS_NAME_CHARACTERS;
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

fw_status fw_owner_save(fw_safety *safety, const fw_owner_record *wanted)
{
    const fw_store *store = &safety->board->store;
    const fw_status status = fw_owner_record_save(store, wanted);
    if (status == FW_OK)
        safety->owner = fw_owner_record_load(store);
    return status;
}

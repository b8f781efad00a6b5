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

/* A board that does not know its designed source or gain does not accept other values. */
uint32_t fw_owner_source_ua(const fw_safety *safety)
{
    const uint32_t designed = safety->board->source_ua;
    return safety->owner.source_ua != 0 && designed != 0 ? safety->owner.source_ua : designed;
}

uint32_t fw_owner_source_ua_rms(const fw_safety *safety)
{
    const uint32_t ua = fw_owner_source_ua(safety);
    return ua == safety->board->source_ua ? safety->board->source_ua_rms
                                          : (uint32_t)((uint64_t)ua * 70711u / 100000u);
}

uint32_t fw_owner_gain_ppm(const fw_safety *safety)
{
    const uint32_t designed = safety->board->gain_ppm;
    return safety->owner.gain_ppm != 0 && designed != 0 ? safety->owner.gain_ppm : designed;
}

fw_capture fw_owner_capture(const fw_safety *safety)
{
    const fw_board *board = safety->board;
    fw_capture capture = board->capture;
    if (board->source_ua != 0 && board->gain_ppm != 0)
        capture.front_end_gain_ppm = (uint32_t)((uint64_t)fw_owner_gain_ppm(safety) *
                                                fw_owner_source_ua(safety) / FW_MODEL_UA);
    return capture;
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
    const bool pressed = (safety->owner.settings & EITS_SETTING_BUTTON_LOW) == 0;
    if ((safety->owner.settings & EITS_SETTING_LOCKED) == 0 ||
        (board->system->button != NULL && board->system->button(board->system_ctx) == pressed))
        return false;
    fw_fault_set(safety, EITS_FAULT_LOCKED, true, (fw_fault_detail){.index = (int32_t)command});
    return true;
}

static uint32_t kept_or(uint32_t wanted, uint32_t now)
{
    return wanted == EITS_KEPT ? now : wanted;
}

fw_status fw_owner_save(fw_safety *safety, const fw_owner_record *wanted)
{
    const fw_store *store = &safety->board->store;
    const fw_owner_record *now = &safety->owner;
    fw_owner_record saved = *wanted;
    saved.current_limit_ua_rms = kept_or(wanted->current_limit_ua_rms, now->current_limit_ua_rms);
    saved.source_ua = kept_or(wanted->source_ua, now->source_ua);
    saved.gain_ppm = kept_or(wanted->gain_ppm, now->gain_ppm);
    const fw_status status = fw_owner_record_save(store, &saved);
    if (status == FW_OK)
        safety->owner = fw_owner_record_load(store);
    return status;
}

#include "app/safety/current_enable.h"

#include "app/clock.h"
#include "app/safety/faults.h"
#include "app/safety/owner.h"
#include "app/safety/state.h"

/* IEC 60601-1, patient auxiliary current: 100 uA rms up to 1 kHz, and above that in proportion to
 * the frequency, so that each microampere needs 10 Hz. */
enum { SAFE_UA_RMS = 100, MILLIHZ_PER_UA = 10000, MIN_MILLIHZ = 1000 };

bool fw_current_on(fw_safety *safety)
{
    fw_current *current = &safety->current;
    if (current->state == EITS_DRIVE_ON)
        return true;
    if (current->state == EITS_DRIVE_TRIPPED)
        return false;
    current->state = EITS_DRIVE_ON;
    current->settling = safety->board->settle_frames;
    current->sensed_us = fw_now_us(safety->board);
    safety->current_changed(safety->user);
    return true;
}

void fw_current_off(fw_safety *safety, eits_drive why)
{
    safety->current.state = why;
    safety->current.ua_rms = 0;
    safety->current_changed(safety->user);
}

void fw_current_heard(fw_safety *safety)
{
    safety->current.heard_us = fw_now_us(safety->board);
}

/* A wrong part, a short circuit or a wire that touches another changes the current. */
static void check_limit(fw_safety *safety, uint32_t now_us)
{
    const fw_sense *sense = &safety->board->sense;
    fw_current *current = &safety->current;
    if ((safety->owner.settings & EITS_SETTING_SENSE) == 0 || sense->measure_ua_rms == NULL ||
        now_us - current->sensed_us < FW_SENSE_US)
        return;
    current->sensed_us = now_us;
    const uint32_t ua = sense->measure_ua_rms(sense->ctx);
    const uint32_t limit_ua = fw_current_limit_ua(safety);
    if (limit_ua != 0 && ua > limit_ua) {
        fw_current_off(safety, EITS_DRIVE_TRIPPED);
        fw_fault_set(safety, EITS_FAULT_CURRENT, true, (fw_fault_detail){.value = (int32_t)ua});
    }
    current->ua_rms = ua;
}

void fw_current_check(fw_safety *safety, bool scanning)
{
    const fw_current *current = &safety->current;
    if (current->state != EITS_DRIVE_ON || safety->board->frames_given)
        return; /* frames that are given: another instrument drives the current */
    const uint32_t now_us = fw_now_us(safety->board);
    if (!fw_owner_keeps_current(safety) && now_us - current->heard_us > FW_SILENT_US)
        fw_current_off(safety, EITS_DRIVE_SILENT);
    else if (scanning)
        check_limit(safety, now_us);
}

void fw_current_clear_trip(fw_safety *safety)
{
    if (safety->current.state == EITS_DRIVE_TRIPPED)
        safety->current.state = EITS_DRIVE_OFF;
}

bool fw_current_allowed(const fw_safety *safety)
{
    return safety->current.state == EITS_DRIVE_ON;
}

eits_drive fw_current_state(const fw_safety *safety)
{
    return safety->current.state;
}

uint32_t fw_current_ua(const fw_safety *safety)
{
    return safety->current.ua_rms;
}

uint32_t fw_current_limit_ua(const fw_safety *safety)
{
    const uint32_t limit_ua = safety->owner.current_limit_ua_rms;
    const uint32_t source_ua = fw_owner_source_ua_rms(safety);
    return limit_ua != 0 ? limit_ua : source_ua + source_ua / 4;
}

uint32_t fw_current_min_millihz(const fw_safety *safety)
{
    const uint32_t ua = fw_owner_source_ua_rms(safety);
    return ua <= SAFE_UA_RMS ? MIN_MILLIHZ : ua * MILLIHZ_PER_UA;
}

bool fw_current_settling(const fw_safety *safety)
{
    return safety->current.settling > 0;
}

bool fw_current_drops_frame(fw_safety *safety)
{
    if (safety->current.settling == 0)
        return false;
    --safety->current.settling;
    return true;
}

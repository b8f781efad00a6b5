#include "app/safety/current_enable.h"

#include "app/link/scanning.h"

bool fw_drive_on(fw_instrument *instrument)
{
    fw_drive *drive = &instrument->drive;
    if (drive->state == EITS_DRIVE_ON)
        return true;
    if (drive->state == EITS_DRIVE_TRIPPED)
        return false;
    drive->state = EITS_DRIVE_ON;
    drive->settling = instrument->board->settle_frames;
    drive->sensed_us = fw_now_us(instrument);
    fw_start_scan(instrument);
    return true;
}

void fw_drive_off(fw_instrument *instrument, eits_drive why)
{
    instrument->drive.state = why;
    instrument->drive.current_ua = 0;
    instrument->stream.what = 0;
    fw_fail_tare(instrument, EITS_E_REFERENCE_SHORT);
    fw_start_scan(instrument); /* which stops it, and the generator */
}

void fw_drive_heard(fw_instrument *instrument)
{
    instrument->drive.heard_us = fw_now_us(instrument);
}

/* A wrong part, a short or a wire that touches: what flows is not what the source should give. */
static void check_current(fw_instrument *instrument, uint32_t now_us)
{
    const fw_sense *sense = &instrument->board->sense;
    fw_drive *drive = &instrument->drive;
    if ((instrument->kept.settings & EITS_SETTING_SENSE) == 0 || sense->measure_ua_rms == NULL ||
        !instrument->scan.running || now_us - drive->sensed_us < FW_SENSE_US)
        return;
    drive->sensed_us = now_us;
    const uint32_t ua = sense->measure_ua_rms(sense->ctx);
    const uint32_t limit_ua =
        fw_current_limit_ua(&instrument->kept, instrument->board->source_ua_rms);
    if (limit_ua != 0 && ua > limit_ua) {
        fw_drive_off(instrument, EITS_DRIVE_TRIPPED);
        fw_fault_set(&instrument->faults, EITS_FAULT_CURRENT, true,
                     (fw_fault_detail){.frame = instrument->last_frame, .value = (int32_t)ua});
    }
    drive->current_ua = ua;
}

void fw_drive_check(fw_instrument *instrument)
{
    const fw_drive *drive = &instrument->drive;
    if (drive->state != EITS_DRIVE_ON || instrument->board->frames_given)
        return; /* another instrument's current is not ours */
    const uint32_t now_us = fw_now_us(instrument);
    if ((instrument->kept.settings & EITS_SETTING_KEEP_DRIVE) == 0 &&
        now_us - drive->heard_us > FW_SILENT_US)
        fw_drive_off(instrument, EITS_DRIVE_SILENT);
    else
        check_current(instrument, now_us);
}

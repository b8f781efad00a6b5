/* Starting and stopping the generator and the scan. */
#ifndef FW_SCAN_CONTROL_H
#define FW_SCAN_CONTROL_H

#include "app/instrument.h"

/* Start generator and scan where they are wanted, else stop both; what cannot be started
 * is tried again. */
void fw_start_scan(fw_instrument *instrument);
/* Open the multiplexers and let go of the converter; what the lines say where they do not open. */
fw_status fw_stop_scan(fw_instrument *instrument);
/* Whether there should be one: the drive is on, a model is open, no upload is under way. */
bool fw_scan_wanted(const fw_instrument *instrument);

/* What the converter's steps alone make of noise with the scan's settings; 0 where the frames are
 * another instrument's. */
float fw_noise_floor_v(const fw_instrument *instrument);

/* A tare that cannot go on is answered, and the last reference put back. */
void fw_fail_tare(fw_instrument *instrument, eits_status why);

#endif

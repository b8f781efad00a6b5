/* The state of the safety module. Besides its own files only app/instrument.h may include this
 * file. */
#ifndef FW_SAFETY_STATE_H
#define FW_SAFETY_STATE_H

#include "app/safety/owner_record.h"
#include "eitskin/link.h"
#include "hal/hal.h"

typedef struct fw_faults {
    uint32_t frame;              /* number of the frame that is processed, or was last */
    uint32_t raised;             /* bit k: fault number k */
    uint64_t there[EITS_FAULTS]; /* bit e: of electrode e; bit 0 for faults of no electrode */
    /* consecutive frames that contradict `there`, by the same bits */
    uint8_t run[EITS_FAULTS][FW_MAX_ELECTRODES];
} fw_faults;

typedef struct fw_current {
    eits_drive state;
    uint32_t heard_us; /* last packet from the host */
    uint32_t settling; /* frames that are still dropped */
    uint32_t sensed_us, ua_rms;
} fw_current;

struct fw_safety {
    const fw_board *board;
    fw_faults faults;
    fw_current current;
    fw_owner_record owner; /* the settings in use */
    void (*fault_changed)(void *user, const eits_packet_fault *fault);
    void (*current_changed)(void *user);
    void *user;
};

#endif

/* The permission for current, the owner's settings, and the list of faults. This module uses no
 * other module: it reports through the two functions below. */
#ifndef FW_SAFETY_H
#define FW_SAFETY_H

#include "eitskin/link.h"
#include "hal/hal.h"

typedef struct fw_safety fw_safety;

typedef struct fw_safety_hooks {
    /* a fault was raised or cleared */
    void (*fault_changed)(void *user, const eits_packet_fault *fault);
    /* fw_current_allowed may have changed: start the scan, or stop it before this returns */
    void (*current_changed)(void *user);
    void *user;
} fw_safety_hooks;

/* Initialise the module: current is not allowed, no fault is raised, and the owner's settings are
 * loaded from flash. */
void fw_safety_init(fw_safety *safety, const fw_board *board, fw_safety_hooks hooks);

#endif

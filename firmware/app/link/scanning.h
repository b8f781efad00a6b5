/* Starts the scan when it is needed, and stops it when it is not, together with everything that
 * depends on it: a running tare, the tracker, the phase. */
#ifndef FW_SCANNING_H
#define FW_SCANNING_H

#include "eitskin/link.h"

typedef struct fw_host_link fw_host_link;

/* Stop, and start again if current is allowed, a model is open, and no upload is under way. A start
 * that fails is tried again later. */
void fw_scanning_restart(fw_host_link *link);

/* Call once per turn of the main loop: starts a scan again that has stalled, or that could not be
 * started. */
void fw_scanning_watch(fw_host_link *link);

/* Call once per turn of the main loop: sends a fixed row's burst when it is there, and lets the
 * scan go on. */
void fw_scanning_probed(fw_host_link *link);

/* For fw_safety_hooks; `link` is a fw_host_link. */
void fw_scanning_current_changed(void *link);

#endif

/* A tare learns the reference from untouched frames. If it fails, the last reference is restored.
 */
#ifndef FW_TARE_H
#define FW_TARE_H

#include "app/acquire/frame.h"
#include "eitskin/eitskin.h"

typedef struct fw_solve fw_solve;

#define FW_TARE_MAX     1024u
/* The tare fails if the core rejects more frames than this, for instance for a saturated row. */
#define FW_TARE_REFUSED 16u

typedef enum fw_tare_step {
    FW_TARE_NOT_YET, /* the frame is older than the command */
    FW_TARE_REFUSED_FRAME,
    FW_TARE_TAKEN,
    FW_TARE_DONE,  /* with this frame */
    FW_TARE_FAILED /* status says why; the last reference is back */
} fw_tare_step;

/* Begin a tare. `frames` is 1, or 4 to FW_TARE_MAX. */
void fw_tare_begin(fw_solve *solve, uint32_t request, uint32_t frames);

bool fw_tare_active(const fw_solve *solve);
uint32_t fw_tare_request(const fw_solve *solve); /* of the last one that was begun */

/* The first function returns whether the frame belongs to the tare, the second whether no frame has
 * been taken for it yet. */
bool fw_tare_wants(const fw_solve *solve, const fw_frame *frame);
bool fw_tare_first(const fw_solve *solve);

/* Take a checked frame. */
fw_tare_step fw_tare_add(fw_solve *solve, const fw_frame *frame, eits_status *status);

/* End the tare without a result; the last reference is restored. Returns whether a tare was active.
 */
bool fw_tare_abort(fw_solve *solve);

/* Restore the reference that the last tare replaced. Returns false if it is not available: there
 * was none, it has been restored already, or scan, model or masks have changed since. */
bool fw_tare_undo(fw_solve *solve);

#endif

/* Learning the reference from reference frames. Until it is done, the last reference stays; should
 * it fail, it comes back. */
#ifndef FW_TARE_H
#define FW_TARE_H

#include "app/solve/engine.h"

#define FW_TARE_MAX 1024u
#define FW_TARE_REFUSED \
    16u /* reference frames that may be refused (a saturated row...) before the tare fails */

typedef struct fw_tare {
    bool active;
    uint32_t request, wanted, taken, refused;
    uint32_t since_us; /* frames whose scan began earlier are not untouched ones */
} fw_tare;

typedef enum fw_tare_step {
    FW_TARE_NOT_YET, /* the frame is older than the command */
    FW_TARE_REFUSED_FRAME,
    FW_TARE_TAKEN,
    FW_TARE_DONE,  /* with this frame */
    FW_TARE_FAILED /* status says why; the last reference is back */
} fw_tare_step;

/* 1 frame, or 4 to FW_TARE_MAX. */
void fw_tare_begin(fw_tare *tare, fw_engine *engine, uint32_t request, uint32_t frames,
                   uint32_t now_us);

/* Whether the frame belongs to the tare; the first such must give the angle (fw_tare_first). */
bool fw_tare_wants(const fw_tare *tare, const fw_frame *frame);
bool fw_tare_first(const fw_tare *tare);

/* Take a checked frame. */
fw_tare_step fw_tare_add(fw_tare *tare, fw_engine *engine, const fw_frame *frame,
                         eits_status *status);

/* Give up: the last reference is back. */
void fw_tare_abort(fw_tare *tare, fw_engine *engine);

#endif

/* eitskin: what is found wrong with a frame, said by name. docs/reference/diagnostics.md has each
 * rule and what to do about it.
 *
 * The frame stage looks at rows and electrodes before anything is solved, and leaves out what would
 * spoil the image; the solver and the touch fit look at what came of it. A finding is no error: the
 * frame is imaged as well as what is left of it allows, and eits_info says what was found. Only
 * where more rows are left out than options.max_masked is the frame refused, its findings still
 * named. eits_options.findings chooses what is looked for; SATURATED rows are left out whether it
 * is named or not.
 */
#ifndef EITSKIN_FINDINGS_H
#define EITSKIN_FINDINGS_H

#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bits of eits_info.findings and eits_options.findings. Numbers are never used again for something
 * else. */
typedef enum eits_finding {
    /* rows at or beyond options.saturation_v: left out; info.saturated counts them */
    EITS_FINDING_SATURATED = 1,
    /* info.open_electrodes: all rows that use them are left out */
    EITS_FINDING_ELECTRODE_OPEN = 2,
    /* info.bridged_electrodes, of one or more pairs: likewise */
    EITS_FINDING_BRIDGED = 4,
    /* single rows that nothing else bears out: left out; info.glitches counts them */
    EITS_FINDING_GLITCH = 8,
    /* info.noisy_electrodes: too many glitches share them; all rows that use them are left out */
    EITS_FINDING_ELECTRODE_NOISY = 16,
    /* no sheet of the model's gives such data; info.misfit says how much of them. Imaged as is */
    EITS_FINDING_MISFIT = 32,
    /* the change goes the way touches cannot: tare again. Imaged as is */
    EITS_FINDING_STALE_REFERENCE = 64,
    /* more touches than can be told apart, by eits_find_touches: count and places are a guess */
    EITS_FINDING_CROWDED = 128
} eits_finding;
#define EITS_FINDINGS_ALL 255u

/* Why a row is left out of a frame: bits of ctx->unusable[row], 0 for a row in use. */
typedef enum eits_row_state {
    EITS_ROW_MASKED = 1,  /* by eits_mask_row, or while the reference was taken */
    EITS_ROW_UNKNOWN = 2, /* not a finite number */
    EITS_ROW_SATURATED = 4,
    EITS_ROW_OPEN = 8,     /* uses an open electrode */
    EITS_ROW_BRIDGED = 16, /* uses an electrode of a bridged pair */
    EITS_ROW_GLITCH = 32,
    EITS_ROW_NOISY = 64 /* uses a noisy electrode */
} eits_row_state;

/* Bits of ctx->electrode[e]; 0 for an electrode that nothing was found about. */
typedef enum eits_electrode_state {
    EITS_ELECTRODE_OPEN = 1,
    EITS_ELECTRODE_BRIDGED = 2,
    EITS_ELECTRODE_NOISY = 4
} eits_electrode_state;

/* An electrode's place in a row of the protocol takes a byte. */
#define EITS_MOST_ELECTRODES 256u

/* A name for one bit of eits_finding ("electrode open", "glitch"...), never NULL. */
const char *eits_finding_text(eits_finding finding);

#ifdef __cplusplus
}
#endif
#endif

/* eitskin: what is found wrong with a frame, said by name. docs/reference/diagnostics.md has each
 * rule and what to do about it.
 *
 * The frame stage looks at rows and electrodes before anything is solved, and leaves out what would
 * spoil the image; the solver and the touch fit look at what came of it. A diagnostic is no error:
 * the frame is imaged as well as what is left of it allows, and eits_info says what was found. Only
 * where more rows are left out than options.max_masked is the frame refused, its diagnostics still
 * named. eits_options.diagnostics chooses what is looked for; SATURATED rows are left out whether
 * it is named or not.
 */
#ifndef EITSKIN_DIAGNOSTICS_H
#define EITSKIN_DIAGNOSTICS_H

#include "eitskin/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bits of eits_info.diagnostics and eits_options.diagnostics. Numbers are never used again for
 * something else. */
typedef enum eits_diagnostic {
    /* rows at or beyond options.saturation_v: left out; info.saturated counts them */
    EITS_DIAGNOSTIC_SATURATED = 1,
    /* info.open_electrodes: all rows that use them are left out */
    EITS_DIAGNOSTIC_ELECTRODE_OPEN = 2,
    /* info.bridged_electrodes, of one or more pairs: likewise */
    EITS_DIAGNOSTIC_BRIDGED = 4,
    /* single rows that nothing else bears out: left out; info.outliers counts them */
    EITS_DIAGNOSTIC_OUTLIER = 8,
    /* info.noisy_electrodes: too many outliers have them in common; all rows that use them are
     * left out */
    EITS_DIAGNOSTIC_ELECTRODE_NOISY = 16,
    /* no change of conductivity gives such data by this model; info.model_mismatch says how much
     * of them is out of its range. Imaged as is */
    EITS_DIAGNOSTIC_MODEL_MISMATCH = 32,
    /* the change goes the way touches cannot: tare again. Imaged as is */
    EITS_DIAGNOSTIC_STALE_REFERENCE = 64,
    /* more touches than can be told apart, by eits_find_touches: count and places are a guess */
    EITS_DIAGNOSTIC_CROWDED = 128
} eits_diagnostic;
#define EITS_DIAGNOSTICS_ALL 255u

/* Why a row is left out of a frame: bits of eits_get_row_states, 0 for a row in use. */
typedef enum eits_row_state {
    EITS_ROW_MASKED = 1,  /* by eits_mask_row, or while the reference was taken */
    EITS_ROW_UNKNOWN = 2, /* not a finite number */
    EITS_ROW_SATURATED = 4,
    EITS_ROW_OPEN = 8,     /* uses an open electrode */
    EITS_ROW_BRIDGED = 16, /* uses an electrode of a bridged pair */
    EITS_ROW_OUTLIER = 32,
    EITS_ROW_NOISY = 64 /* uses a noisy electrode */
} eits_row_state;

/* Bits of eits_get_electrode_states; 0 for an electrode that nothing was found about. */
typedef enum eits_electrode_state {
    EITS_ELECTRODE_OPEN = 1,
    EITS_ELECTRODE_BRIDGED = 2,
    EITS_ELECTRODE_NOISY = 4
} eits_electrode_state;

/* An electrode's place in a row of the protocol takes a byte. */
#define EITS_MAX_ELECTRODES 256u

/* A name for one bit of eits_diagnostic ("electrode open", "outlier"...), never NULL. */
const char *eits_diagnostic_text(eits_diagnostic diagnostic);

#ifdef __cplusplus
}
#endif
#endif

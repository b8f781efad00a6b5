/* Four ADG1206 16:1 multiplexers, one each for I+, I-, V+ and V-, switched together.
 *
 * Each decodes its own address, so it connects at most one electrode. All are disabled while their
 * addresses change. So two electrodes are never connected through one multiplexer, whatever the
 * skew of the address lines. */
#ifndef FW_ADG1206_H
#define FW_ADG1206_H

#include "hal/hal.h"

#define FW_ELECTRODES 16u

/* tOFF(EN): at most 140 ns from -40 to 125 C on +-15 V (ADG1206/ADG1207 data sheet, Table 1);
 * margin for 12 V supplies. The part's own break before make (tBBM, at least 10 ns) covers a change
 * of address only. */
#define FW_ADG1206_OFF_NS 200u

#define FW_MUX_ADDRESSES 0x0000FFFFu
#define FW_MUX_ENABLES   0x000F0000u

typedef struct fw_adg1206 {
    fw_lines lines;
} fw_adg1206;

/* The address lines that drive through i_plus and i_minus, and measure from v_plus to v_minus.
 * Errors: FW_E_ARGUMENT (an electrode above 15, or both of a pair the same). */
fw_status fw_adg1206_addresses(const uint8_t electrodes[4], uint32_t *addresses);

/* Connect the electrodes that these address lines choose. Errors: those of the lines (all are left
 * disabled then, if the lines still work). */
fw_status fw_adg1206_join(const fw_adg1206 *bank, uint32_t addresses);

/* Both: nothing is switched if an electrode is wrong. */
fw_status fw_adg1206_select(const fw_adg1206 *bank, const uint8_t electrodes[4]);

/* Disconnect all electrodes. Errors: those of the lines. */
fw_status fw_adg1206_all_off(const fw_adg1206 *bank);

#endif

/* ADG1206 16:1 multiplexers: four for each 16 electrodes, one each for I+, I-, V+ and V-, switched
 * together.
 *
 * Each decodes its own address, so it connects at most one electrode. All are disabled while their
 * addresses change. So two electrodes are never connected through one multiplexer, whatever the
 * skew of the address lines. The multiplexers of electrodes 16 to 31 and so on share the address
 * lines of the first four, and have enables of their own. */
#ifndef FW_ADG1206_H
#define FW_ADG1206_H

#include "hal/hal.h"

/* tOFF(EN): at most 140 ns from -40 to 125 C on +-15 V (ADG1206/ADG1207 data sheet, Table 1);
 * margin for 12 V supplies. The part's own break before make (tBBM, at least 10 ns) covers a change
 * of address only. */
#define FW_ADG1206_OFF_NS 200u

typedef struct fw_adg1206 {
    fw_lines lines;
    uint32_t enables; /* the lines that are enables */
} fw_adg1206;

/* The parts behind these lines as the application's multiplexers; `electrodes` is 16, 32, 48 or 64.
 * Lines 0-3 are A0..A3 of I+, 4-7 of I-, 8-11 of V+, 12-15 of V-; 16..19 enable I+, I-, V+, V- of
 * electrodes 0 to 15, 20..23 those of electrodes 16 to 31, and so on. `parts` must live as long as
 * the board. */
fw_multiplexers fw_adg1206_multiplexers(fw_adg1206 *parts, fw_lines lines, uint32_t electrodes);

/* As fw_multiplexers_ops says; ctx is the fw_adg1206. */
fw_status fw_adg1206_join(void *ctx, uint32_t electrodes);
fw_status fw_adg1206_all_off(void *ctx);

#endif

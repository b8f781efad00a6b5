#include "drivers/adg1206.h"

#define ADDRESSES    0x0000FFFFu
#define FIRST_ENABLE 16u
#define SWITCHES     4u  /* I+, I-, V+, V- */
#define OF_ONE_PART  16u /* electrodes */

fw_status fw_adg1206_all_off(void *ctx)
{
    const fw_adg1206 *parts = ctx;
    return parts->lines.ops->write(parts->lines.ctx, parts->enables, 0);
}

fw_status fw_adg1206_join(void *ctx, uint32_t electrodes)
{
    const fw_adg1206 *parts = ctx;
    const fw_lines *lines = &parts->lines;
    uint32_t addresses = 0, enables = 0;
    for (uint32_t k = 0; k < SWITCHES; ++k) {
        const uint32_t electrode = electrodes >> 8 * k & 0xFFu;
        addresses |= electrode % OF_ONE_PART << 4 * k;
        enables |= 1u << (FIRST_ENABLE + SWITCHES * (electrode / OF_ONE_PART) + k);
    }
    fw_status status = fw_adg1206_all_off(ctx);
    if (status != FW_OK)
        return status;
    lines->ops->wait_ns(lines->ctx, FW_ADG1206_OFF_NS);
    status = lines->ops->write(lines->ctx, ADDRESSES, addresses);
    if (status == FW_OK)
        status = lines->ops->write(lines->ctx, parts->enables, enables);
    if (status != FW_OK)
        (void)fw_adg1206_all_off(ctx);
    return status;
}

fw_multiplexers fw_adg1206_multiplexers(fw_adg1206 *parts, fw_lines lines, uint32_t electrodes)
{
    static const fw_multiplexers_ops ops = {fw_adg1206_join, fw_adg1206_all_off};
    const uint64_t end = (uint64_t)1 << (FIRST_ENABLE + SWITCHES * (electrodes / OF_ONE_PART));
    *parts = (fw_adg1206){lines, (uint32_t)(end - 1u) & ~ADDRESSES};
    return (fw_multiplexers){&ops, parts, electrodes};
}

#include "drivers/adg1206.h"

fw_status fw_adg1206_all_off(const fw_adg1206 *bank)
{
    return bank->lines.ops->write(bank->lines.ctx, FW_MUX_ENABLES, 0);
}

fw_status fw_adg1206_addresses(const uint8_t electrodes[4], uint32_t *addresses)
{
    uint32_t lines = 0;
    for (uint32_t k = 0; k < 4; ++k) {
        if (electrodes[k] >= FW_ELECTRODES)
            return FW_E_ARGUMENT;
        lines |= (uint32_t)electrodes[k] << (4 * k);
    }
    if (electrodes[0] == electrodes[1] || electrodes[2] == electrodes[3])
        return FW_E_ARGUMENT;
    *addresses = lines;
    return FW_OK;
}

fw_status fw_adg1206_join(const fw_adg1206 *bank, uint32_t addresses)
{
    const fw_lines *lines = &bank->lines;
    fw_status status = fw_adg1206_all_off(bank);
    if (status != FW_OK)
        return status;
    lines->ops->wait_ns(lines->ctx, FW_ADG1206_OFF_NS);
    status = lines->ops->write(lines->ctx, FW_MUX_ADDRESSES, addresses);
    if (status == FW_OK)
        status = lines->ops->write(lines->ctx, FW_MUX_ENABLES, FW_MUX_ENABLES);
    if (status != FW_OK)
        (void)fw_adg1206_all_off(bank);
    return status;
}

fw_status fw_adg1206_select(const fw_adg1206 *bank, const uint8_t electrodes[4])
{
    uint32_t addresses = 0;
    const fw_status status = fw_adg1206_addresses(electrodes, &addresses);
    return status == FW_OK ? fw_adg1206_join(bank, addresses) : status;
}

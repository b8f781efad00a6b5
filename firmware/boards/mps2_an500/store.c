/* Flash in memory: erased, then "bank0.bin" and "bank1.bin" where there are such. */
#include "mps2.h"

#include <string.h>

static _Alignas(16) uint8_t banks[FW_BANKS][MPS2_BANK_BYTES];

static const uint8_t *bank_start(void *ctx, uint32_t bank)
{
    (void)ctx;
    return banks[bank];
}

static fw_status erase(void *ctx, uint32_t bank)
{
    (void)ctx;
    if (bank >= FW_BANKS)
        return FW_E_ARGUMENT;
    memset(banks[bank], 0xFF, MPS2_BANK_BYTES);
    return FW_OK;
}

static fw_status program(void *ctx, uint32_t bank, uint32_t offset, const void *bytes, size_t size)
{
    (void)ctx;
    if (bank >= FW_BANKS || offset % 4u != 0 || size % 4u != 0 || offset > MPS2_BANK_BYTES ||
        size > MPS2_BANK_BYTES - offset)
        return FW_E_ARGUMENT;
    for (size_t k = 0; k < size; ++k) /* bits fall, none rises */
        banks[bank][offset + k] &= ((const uint8_t *)bytes)[k];
    return memcmp(banks[bank] + offset, bytes, size) == 0 ? FW_OK : FW_E_FLASH;
}

void mps2_store_start(void)
{
    static const char *const names[FW_BANKS] = {"bank0.bin", "bank1.bin"};
    for (uint32_t bank = 0; bank < FW_BANKS; ++bank) {
        (void)erase(NULL, bank);
        (void)mps2_load(names[bank], banks[bank], MPS2_BANK_BYTES);
    }
}

const fw_store_ops mps2_store_ops = {bank_start, erase, program};

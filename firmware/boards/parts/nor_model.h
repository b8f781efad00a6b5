/* Model of flash for boards without hardware: erasing sets all bits; programming only clears bits.
 */
#ifndef NOR_MODEL_H
#define NOR_MODEL_H

#include "hal/hal.h"

#include <string.h>

static inline fw_status nor_model_erase(uint8_t *bank, uint32_t bank_bytes)
{
    memset(bank, 0xFF, bank_bytes);
    return FW_OK;
}

/* Errors: FW_E_ARGUMENT (not whole words, or outside), FW_E_FLASH (it reads back differently). */
static inline fw_status nor_model_program(uint8_t *bank, uint32_t bank_bytes, uint32_t offset,
                                          const void *bytes, size_t size)
{
    if (offset % 4u != 0 || size % 4u != 0 || offset > bank_bytes || size > bank_bytes - offset)
        return FW_E_ARGUMENT;
    for (size_t k = 0; k < size; ++k)
        bank[offset + k] &= ((const uint8_t *)bytes)[k];
    return memcmp(bank + offset, bytes, size) == 0 ? FW_OK : FW_E_FLASH;
}

#endif

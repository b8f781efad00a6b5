/* SPI3 to the AD9833: SCK PC10, MOSI PC12, FSYNC PD2. */
#include "nucleo.h"

enum { FSYNC = 2, WORD_US = 100 }; /* a word takes 5 us */

static void select_chip(bool selected)
{
    GPIO_BSRR(GPIOD_BASE) = selected ? 1u << (FSYNC + 16) : 1u << FSYNC;
}

void nucleo_generator_start(void)
{
    select_chip(false);
    nucleo_pin(GPIOD_BASE, FSYNC, PIN_OUTPUT, 0, 1, 0);
    /* SCLK idles high and the AD9833 takes data on its falling edge (AD9833 data sheet, figure 3):
     * mode 2. */
    const uint32_t mode = SPI_CR1_CPOL;
    /* 54 MHz / 16 = 3.4 MHz, slow enough for long wires */
    const uint32_t prescaler = 3u << SPI_CR1_BR_POS;
    SPI_CR2(SPI3_BASE) = 15u << SPI_CR2_DS_POS; /* 16 bits */
    SPI_CR1(SPI3_BASE) = mode | prescaler | SPI_CR1_MSTR | SPI_CR1_SSM | SPI_CR1_SSI;
    SPI_CR1(SPI3_BASE) |= SPI_CR1_SPE; /* levels are defined before the pins are connected */
    nucleo_pin(GPIOC_BASE, 10, PIN_ALTERNATE, 6, 1, 0);
    nucleo_pin(GPIOC_BASE, 12, PIN_ALTERNATE, 6, 1, 0);
}

static bool status_becomes(uint32_t mask, uint32_t value)
{
    const uint32_t start = nucleo_time_us(NULL);
    while ((SPI_SR(SPI3_BASE) & mask) != value)
        if (nucleo_time_us(NULL) - start > WORD_US)
            return false;
    return true;
}

static fw_status write_words(void *ctx, const uint16_t *words, size_t count)
{
    (void)ctx;
    const uint32_t queued = 3u << SPI_SR_FTLVL_POS;
    fw_status status = FW_OK;
    for (size_t k = 0; k < count && status == FW_OK; ++k) {
        select_chip(true);
        if (status_becomes(SPI_SR_TXE, SPI_SR_TXE))
            SPI_DR(SPI3_BASE) = words[k];
        else
            status = FW_E_TIMEOUT;
        /* All words have been sent when the FIFO is empty and the shifter is idle after that
         * (RM0410 35.5.9).
         */
        if (!status_becomes(queued, 0) || !status_becomes(SPI_SR_BSY, 0))
            status = FW_E_TIMEOUT;
        select_chip(false);
    }
    return status;
}

const fw_spi_ops nucleo_generator_ops = {write_words};

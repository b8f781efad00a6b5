/* The link: UART 0 (Arm DDI 0479, 4.3), which QEMU connects to a pseudo-terminal, a socket or a
 * pipe. QEMU sends a byte at once, and gives the next one when the last was read. */
#include "example.h"

#define UART_DATA     REG32(0x40004000u)
#define UART_STATE    REG32(0x40004004u)
#define UART_CTRL     REG32(0x40004008u)
#define UART_INTCLEAR REG32(0x4000400Cu)
#define UART_BAUDDIV  REG32(0x40004010u)
#define NVIC_ISER     REG32(0xE000E100u)
#define IRQ_UART0_RX  0u
#define STATE_TX_FULL 1u
#define STATE_RX_FULL 2u
#define CTRL_TX_RX    3u
#define CTRL_RX_IRQ   8u
#define RX_IRQ        2u
#define FASTEST       16u

void example_link_start(void)
{
    UART_BAUDDIV = FASTEST;
    UART_CTRL = CTRL_TX_RX | CTRL_RX_IRQ;
    NVIC_ISER = 1u << IRQ_UART0_RX;
}

/* It ends the main loop's wait. */
void example_link_irq(void)
{
    UART_INTCLEAR = RX_IRQ;
    mps2_wake();
}

static bool write_bytes(void *ctx, const uint8_t *bytes, size_t size)
{
    (void)ctx;
    mps2_hold_time();
    for (size_t k = 0; k < size; ++k) {
        while ((UART_STATE & STATE_TX_FULL) != 0)
            ;
        UART_DATA = bytes[k];
    }
    mps2_release_time();
    return true;
}

static size_t read_bytes(void *ctx, uint8_t *bytes, size_t room)
{
    size_t size = 0;
    (void)ctx;
    while (size < room && (UART_STATE & STATE_RX_FULL) != 0)
        bytes[size++] = (uint8_t)UART_DATA;
    return size;
}

const fw_link_ops example_link_ops = {write_bytes, read_bytes, NULL};

/* This function is needed by the sampling of boards/mps2_an500, whose link is a file. */
bool mps2_link_ended(void *ctx)
{
    (void)ctx;
    return false;
}

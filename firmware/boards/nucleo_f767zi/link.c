/* USART3 at 1 Mbaud through the ST-LINK's virtual COM port: TX PD8, RX PD9. DMA moves the bytes
 * both ways, between rings in DTCM; counts run freely and wrap. */
#include "nucleo.h"

#include <string.h>

/* streams 3 and 1 of DMA1 (RM0410 table 26) */
enum { TX_BYTES = 32768, RX_BYTES = 16384, TX = 3, RX = 1, CHANNEL = 4 };
#define BAUD 1000000u
#define TX_FLAGS \
    (DMA_LISR_FEIF3 | DMA_LISR_DMEIF3 | DMA_LISR_TEIF3 | DMA_LISR_HTIF3 | DMA_LISR_TCIF3)
#define RX_FLAGS \
    (DMA_LISR_FEIF1 | DMA_LISR_DMEIF1 | DMA_LISR_TEIF1 | DMA_LISR_HTIF1 | DMA_LISR_TCIF1)

NUCLEO_DTCM static uint8_t tx_ring[TX_BYTES], rx_ring[RX_BYTES];
static struct {
    uint32_t written;          /* by the program */
    volatile uint32_t sent;    /* by DMA */
    volatile uint32_t sending; /* bytes of its present transfer; 0: idle */
} tx;
static struct {
    volatile uint32_t laps; /* of DMA around the ring */
    uint32_t taken;         /* by the program */
} rx;

void nucleo_link_start(void)
{
    nucleo_pin(GPIOD_BASE, 8, PIN_ALTERNATE, 7, 1, 0);
    nucleo_pin(GPIOD_BASE, 9, PIN_ALTERNATE, 7, 1,
               1); /* pulled up: without a cable the line is idle */
    USART_BRR(USART3_BASE) = NUCLEO_APB1_HZ / BAUD; /* 54, exactly */
    USART_CR3(USART3_BASE) = USART_CR3_DMAT | USART_CR3_DMAR | USART_CR3_EIE;

    DMA_PAR(DMA1_BASE, RX) = (uint32_t)&USART_RDR(USART3_BASE);
    DMA_M0AR(DMA1_BASE, RX) = (uint32_t)rx_ring;
    DMA_NDTR(DMA1_BASE, RX) = RX_BYTES;
    DMA_CR(DMA1_BASE, RX) = ((uint32_t)CHANNEL << DMA_CR_CHSEL_POS) | (2u << DMA_CR_PL_POS) |
                            DMA_CR_MINC | DMA_CR_CIRC | DMA_CR_TCIE;
    DMA_CR(DMA1_BASE, RX) |= DMA_CR_EN;
    DMA_PAR(DMA1_BASE, TX) = (uint32_t)&USART_TDR(USART3_BASE);

    nucleo_interrupt(IRQ_DMA1_STREAM1, NUCLEO_URGENCY_LINK);
    nucleo_interrupt(IRQ_DMA1_STREAM3, NUCLEO_URGENCY_LINK);
    nucleo_interrupt(IRQ_USART3, NUCLEO_URGENCY_LINK);
    USART_CR1(USART3_BASE) = USART_CR1_TE | USART_CR1_RE | USART_CR1_IDLEIE | USART_CR1_UE;
}

/* Send the next piece up to a wrap. This stream is idle, and its interrupt is disabled. */
static void send_piece(void)
{
    const uint32_t at = tx.sent % TX_BYTES, waiting = tx.written - tx.sent;
    tx.sending = waiting < TX_BYTES - at ? waiting : TX_BYTES - at;
    if (tx.sending == 0)
        return;
    DMA_CR(DMA1_BASE, TX) = ((uint32_t)CHANNEL << DMA_CR_CHSEL_POS) | (1u << DMA_CR_PL_POS) |
                            DMA_CR_MINC | (1u << DMA_CR_DIR_POS) | DMA_CR_TCIE | DMA_CR_TEIE;
    DMA_M0AR(DMA1_BASE, TX) = (uint32_t)&tx_ring[at];
    DMA_NDTR(DMA1_BASE, TX) = tx.sending;
    DSB(); /* the bytes are in memory */
    DMA_CR(DMA1_BASE, TX) |= DMA_CR_EN;
}

static bool write_bytes(void *ctx, const uint8_t *bytes, size_t size)
{
    if (size > TX_BYTES - (tx.written - tx.sent))
        return false;
    const uint32_t at = tx.written % TX_BYTES;
    const size_t first = size < TX_BYTES - at ? size : TX_BYTES - at;
    memcpy(&tx_ring[at], bytes, first);
    memcpy(tx_ring, bytes + first, size - first);
    const uint32_t state = nucleo_lock(ctx);
    tx.written += (uint32_t)size;
    if (tx.sending == 0)
        send_piece();
    nucleo_unlock(ctx, state);
    return true;
}

/* A transfer error ends the stream, too. Its bytes count as sent; the host sees a gap, and the link
 * continues. */
void nucleo_dma1_stream3_irq(void)
{
    const uint32_t flags = DMA_LISR(DMA1_BASE);
    DMA_LIFCR(DMA1_BASE) = TX_FLAGS;
    nucleo_wake();
    if ((flags & (DMA_LISR_TCIF3 | DMA_LISR_TEIF3)) != 0) {
        tx.sent += tx.sending;
        send_piece();
    }
    DSB(); /* the flag is cleared before the interrupt returns */
}

static uint32_t bytes_received(void)
{
    uint32_t laps, left;
    do {
        laps = rx.laps;
        left = DMA_NDTR(DMA1_BASE, RX);
    } while (laps != rx.laps);
    return laps * RX_BYTES + (RX_BYTES - left);
}

static size_t read_bytes(void *ctx, uint8_t *bytes, size_t room)
{
    (void)ctx;
    const uint32_t received = bytes_received();
    uint32_t waiting = received - rx.taken;
    /* negative: DMA has wrapped, and its interrupt has not run yet */
    if ((int32_t)waiting <= 0)
        return 0;
    /* overrun: bytes are lost, and a packet's checksum will be wrong */
    if (waiting > RX_BYTES) {
        rx.taken = received;
        return 0;
    }
    const uint32_t at = rx.taken % RX_BYTES;
    if (waiting > room)
        waiting = (uint32_t)room;
    const uint32_t first = waiting < RX_BYTES - at ? waiting : RX_BYTES - at;
    memcpy(bytes, &rx_ring[at], first);
    memcpy(bytes + first, rx_ring, waiting - first);
    rx.taken += waiting;
    return waiting;
}

void nucleo_dma1_stream1_irq(void)
{
    if ((DMA_LISR(DMA1_BASE) & DMA_LISR_TCIF1) != 0)
        ++rx.laps;
    DMA_LIFCR(DMA1_BASE) = RX_FLAGS;
    nucleo_wake();
    DSB();
}

/* A message has ended, or a byte was bad. Bad bytes are not stored (RM0410 34.5.15). An overrun
 * that is not cleared would stop reception. */
void nucleo_usart3_irq(void)
{
    USART_ICR(USART3_BASE) = USART_ICR_IDLECF | USART_ICR_ORECF | USART_ICR_NCF | USART_ICR_FECF;
    nucleo_wake();
    DSB();
}

const fw_link_ops nucleo_link_ops = {.write = write_bytes, .read = read_bytes};

/* 216 MHz from the 8 MHz of the ST-LINK, which also go out on PA8 for the generator: all clocks
 * have one source. */
#include "nucleo.h"

enum { MAX_TRIES = 1000000 }; /* of a read at 16 MHz: about 0.5 s */

static bool becomes(volatile uint32_t *reg, uint32_t mask, uint32_t value)
{
    for (uint32_t k = 0; k < MAX_TRIES; ++k)
        if ((*reg & mask) == value)
            return true;
    return false;
}

bool nucleo_clock_start(void)
{
    RCC_APB1ENR |= RCC_APB1ENR_PWREN;
    /* the clock needs two cycles (RM0410 5.2.14), and a read takes as long */
    (void)RCC_APB1ENR;
    PWR_CR1 |= 3u << PWR_CR1_VOS_POS; /* scale 1, for above 180 MHz */

    RCC_CR |= RCC_CR_HSEBYP; /* the ST-LINK drives OSC_IN with its MCO (UM1974 6.7.1) */
    RCC_CR |= RCC_CR_HSEON;
    if (!becomes(&RCC_CR, RCC_CR_HSERDY, RCC_CR_HSERDY))
        return false;

    /* 8 MHz / 4 = 2 MHz (the least jitter, 5.3.2), x 216 = 432 MHz, / 2 = 216 MHz; Q and R are not
     * used but must be valid. */
    RCC_PLLCFGR = RCC_PLLCFGR_PLLSRC | (4u << RCC_PLLCFGR_PLLM_POS) |
                  (216u << RCC_PLLCFGR_PLLN_POS) | (0u << RCC_PLLCFGR_PLLP_POS) |
                  (9u << RCC_PLLCFGR_PLLQ_POS) | (2u << RCC_PLLCFGR_PLLR_POS);
    RCC_CR |= RCC_CR_PLLON;
    PWR_CR1 |= PWR_CR1_ODEN; /* over-drive, in the order of 4.1.4 */
    if (!becomes(&PWR_CSR1, PWR_CSR1_ODRDY, PWR_CSR1_ODRDY))
        return false;
    PWR_CR1 |= PWR_CR1_ODSWEN;
    if (!becomes(&PWR_CSR1, PWR_CSR1_ODSWRDY, PWR_CSR1_ODSWRDY) ||
        !becomes(&RCC_CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY))
        return false;

    /* Seven wait states at 216 MHz and 2.7 to 3.6 V (table 7). Prefetch and ART serve the ITCM view
     * of the flash only (3.3.2); the program runs from the AXI view through the caches, and they
     * cost nothing. */
    FLASH_ACR = (7u << FLASH_ACR_LATENCY_POS) | FLASH_ACR_PRFTEN | FLASH_ACR_ARTEN;
    (void)FLASH_ACR;

    /* APB1 / 4 = 54 MHz, APB2 / 2 = 108 MHz */
    const uint32_t buses = (5u << RCC_CFGR_PPRE1_POS) | (4u << RCC_CFGR_PPRE2_POS);
    /* HSE, undivided */
    const uint32_t mco1 = (2u << RCC_CFGR_MCO1_POS) | (0u << RCC_CFGR_MCO1PRE_POS);
    RCC_CFGR = buses | mco1;
    RCC_CFGR = buses | mco1 | (2u << RCC_CFGR_SW_POS); /* PLL */
    if (!becomes(&RCC_CFGR, 3u << RCC_CFGR_SWS_POS, 2u << RCC_CFGR_SWS_POS))
        return false;

    RCC_AHB1ENR |= RCC_AHB1ENR_GPIOAEN | RCC_AHB1ENR_GPIOBEN | RCC_AHB1ENR_GPIOCEN |
                   RCC_AHB1ENR_GPIODEN | RCC_AHB1ENR_GPIOEEN | RCC_AHB1ENR_GPIOFEN;
    RCC_AHB1ENR |= RCC_AHB1ENR_DMA1EN | RCC_AHB1ENR_DMA2EN;
    RCC_APB1ENR |=
        RCC_APB1ENR_TIM2EN | RCC_APB1ENR_TIM3EN | RCC_APB1ENR_TIM5EN | RCC_APB1ENR_USART3EN;
    RCC_APB1ENR |= RCC_APB1ENR_SPI3EN;
    RCC_APB2ENR |= RCC_APB2ENR_ADC1EN | RCC_APB2ENR_ADC2EN;
    (void)RCC_APB2ENR;
    nucleo_pin(GPIOA_BASE, 8, PIN_ALTERNATE, 0, 2, 0); /* MCO1 */
    RCC_CR |= RCC_CR_CSSON;                            /* an NMI if the 8 MHz fail */
    return true;
}

void nucleo_pin(uint32_t port, uint32_t pin, nucleo_pin_mode mode, uint32_t alternate,
                uint32_t speed, uint32_t pull)
{
    const uint32_t at = 2u * pin, nibble = 4u * (pin & 7u);
    volatile uint32_t *const function = pin < 8 ? &GPIO_AFRL(port) : &GPIO_AFRH(port);
    *function = (*function & ~(0xFu << nibble)) | (alternate << nibble);
    GPIO_OSPEEDR(port) = (GPIO_OSPEEDR(port) & ~(3u << at)) | (speed << at);
    GPIO_PUPDR(port) = (GPIO_PUPDR(port) & ~(3u << at)) | (pull << at);
    GPIO_MODER(port) = (GPIO_MODER(port) & ~(3u << at)) | ((uint32_t)mode << at);
}

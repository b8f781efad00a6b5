/* Registers of the STM32F767 that this board uses, from RM0410 (rev. 5) and, for the core, the
 * Armv7-M manual and PM0253.
 *
 * Names are the manuals'. NAME_POS is where a field of several bits begins; other field names are
 * masks of one bit. A test reads this file and compares it with public SVD files; keep one
 * definition a line.
 */
#ifndef STM32F767_H
#define STM32F767_H

#include <stdint.h>

#define REG32(address) (*(volatile uint32_t *)(address))
#define REG16(address) (*(volatile uint16_t *)(address))

/* ---- RCC, chapter 5 ---- */
#define RCC_BASE              0x40023800u
#define RCC_CR                REG32(RCC_BASE + 0x00u)
#define RCC_PLLCFGR           REG32(RCC_BASE + 0x04u)
#define RCC_CFGR              REG32(RCC_BASE + 0x08u)
#define RCC_AHB1ENR           REG32(RCC_BASE + 0x30u)
#define RCC_APB1ENR           REG32(RCC_BASE + 0x40u)
#define RCC_APB2ENR           REG32(RCC_BASE + 0x44u)
#define RCC_CIR               REG32(RCC_BASE + 0x0Cu)
#define RCC_CSR               REG32(RCC_BASE + 0x74u)
#define RCC_CR_HSEON          (1u << 16)
#define RCC_CR_HSERDY         (1u << 17)
#define RCC_CR_HSEBYP         (1u << 18)
#define RCC_CR_PLLON          (1u << 24)
#define RCC_CR_PLLRDY         (1u << 25)
#define RCC_PLLCFGR_PLLM_POS  0u
#define RCC_PLLCFGR_PLLN_POS  6u
#define RCC_PLLCFGR_PLLP_POS  16u
#define RCC_PLLCFGR_PLLSRC    (1u << 22)
#define RCC_PLLCFGR_PLLQ_POS  24u
#define RCC_PLLCFGR_PLLR_POS  28u
#define RCC_CFGR_SW_POS       0u
#define RCC_CFGR_SWS_POS      2u
#define RCC_CFGR_PPRE1_POS    10u
#define RCC_CFGR_PPRE2_POS    13u
#define RCC_CFGR_MCO1_POS     21u
#define RCC_CFGR_MCO1PRE_POS  24u
#define RCC_AHB1ENR_GPIOAEN   (1u << 0)
#define RCC_AHB1ENR_GPIOBEN   (1u << 1)
#define RCC_AHB1ENR_GPIOCEN   (1u << 2)
#define RCC_AHB1ENR_GPIODEN   (1u << 3)
#define RCC_AHB1ENR_GPIOEEN   (1u << 4)
#define RCC_AHB1ENR_GPIOFEN   (1u << 5)
#define RCC_AHB1ENR_DTCMRAMEN (1u << 20)
#define RCC_AHB1ENR_DMA1EN    (1u << 21)
#define RCC_AHB1ENR_DMA2EN    (1u << 22)
#define RCC_APB1ENR_TIM2EN    (1u << 0)
#define RCC_APB1ENR_TIM3EN    (1u << 1)
#define RCC_APB1ENR_TIM5EN    (1u << 3)
#define RCC_APB1ENR_SPI3EN    (1u << 15)
#define RCC_APB1ENR_USART3EN  (1u << 18)
#define RCC_APB1ENR_PWREN     (1u << 28)
#define RCC_CR_CSSON          (1u << 19)
#define RCC_CIR_CSSC          (1u << 23)
#define RCC_APB2ENR_ADC1EN    (1u << 8)
#define RCC_APB2ENR_ADC2EN    (1u << 9)
#define RCC_CSR_RMVF          (1u << 24)
#define RCC_CSR_WDGRSTF       (1u << 29) /* IWDGRSTF in RM0410 */

/* ---- PWR, chapter 4 ---- */
#define PWR_BASE         0x40007000u
#define PWR_CR1          REG32(PWR_BASE + 0x00u)
#define PWR_CSR1         REG32(PWR_BASE + 0x04u)
#define PWR_CR1_PVDE     (1u << 4)
#define PWR_CR1_PLS_POS  5u
#define PWR_CSR1_PVDO    (1u << 2)
#define PWR_CR1_VOS_POS  14u
#define PWR_CR1_ODEN     (1u << 16)
#define PWR_CR1_ODSWEN   (1u << 17)
#define PWR_CSR1_ODRDY   (1u << 16)
#define PWR_CSR1_ODSWRDY (1u << 17)

/* ---- flash interface, chapter 3 ---- */
#define FLASH_BASE            0x40023C00u
#define FLASH_ACR             REG32(FLASH_BASE + 0x00u)
#define FLASH_KEYR            REG32(FLASH_BASE + 0x04u)
#define FLASH_OPTKEYR         REG32(FLASH_BASE + 0x08u)
#define FLASH_SR              REG32(FLASH_BASE + 0x0Cu)
#define FLASH_CR              REG32(FLASH_BASE + 0x10u)
#define FLASH_OPTCR           REG32(FLASH_BASE + 0x14u)
#define FLASH_ACR_LATENCY_POS 0u
#define FLASH_ACR_PRFTEN      (1u << 8)
#define FLASH_ACR_ARTEN       (1u << 9)
#define FLASH_SR_EOP          (1u << 0)
#define FLASH_SR_OPERR        (1u << 1)
#define FLASH_SR_WRPERR       (1u << 4)
#define FLASH_SR_PGAERR       (1u << 5)
#define FLASH_SR_PGPERR       (1u << 6)
#define FLASH_SR_ERSERR       (1u << 7)
#define FLASH_SR_BSY          (1u << 16)
#define FLASH_CR_PG           (1u << 0)
#define FLASH_CR_SER          (1u << 1)
#define FLASH_CR_SNB_POS      3u
#define FLASH_CR_PSIZE_POS    8u
#define FLASH_CR_STRT         (1u << 16)
#define FLASH_CR_LOCK         (1u << 31)
#define FLASH_OPTCR_OPTLOCK   (1u << 0)
#define FLASH_OPTCR_OPTSTRT   (1u << 1)
#define FLASH_OPTCR_BOR_POS   2u
#define FLASH_OPTCR_NDBANK    (1u << 29)
#define FLASH_KEY1            0x45670123u
#define FLASH_KEY2            0xCDEF89ABu
#define FLASH_OPTKEY1         0x08192A3Bu
#define FLASH_OPTKEY2         0x4C5D6E7Fu

/* ---- GPIO, chapter 6 ---- */
#define GPIOA_BASE         0x40020000u
#define GPIOB_BASE         0x40020400u
#define GPIOC_BASE         0x40020800u
#define GPIOD_BASE         0x40020C00u
#define GPIOE_BASE         0x40021000u
#define GPIOF_BASE         0x40021400u
#define GPIO_MODER(port)   REG32((port) + 0x00u)
#define GPIO_OSPEEDR(port) REG32((port) + 0x08u)
#define GPIO_PUPDR(port)   REG32((port) + 0x0Cu)
#define GPIO_IDR(port)     REG32((port) + 0x10u)
#define GPIO_BSRR(port)    REG32((port) + 0x18u)
#define GPIO_AFRL(port)    REG32((port) + 0x20u)
#define GPIO_AFRH(port)    REG32((port) + 0x24u)

/* ---- SPI, chapter 35 ---- */
#define SPI3_BASE        0x40003C00u
#define SPI_CR1(spi)     REG32((spi) + 0x00u)
#define SPI_CR2(spi)     REG32((spi) + 0x04u)
#define SPI_SR(spi)      REG32((spi) + 0x08u)
#define SPI_DR(spi)      REG16((spi) + 0x0Cu)
#define SPI_CR1_CPOL     (1u << 1)
#define SPI_CR1_MSTR     (1u << 2)
#define SPI_CR1_BR_POS   3u
#define SPI_CR1_SPE      (1u << 6)
#define SPI_CR1_SSI      (1u << 8)
#define SPI_CR1_SSM      (1u << 9)
#define SPI_CR2_DS_POS   8u
#define SPI_SR_TXE       (1u << 1)
#define SPI_SR_BSY       (1u << 7)
#define SPI_SR_FTLVL_POS 11u

/* ---- USART, chapter 34 ---- */
#define USART3_BASE      0x40004800u
#define USART_CR1(usart) REG32((usart) + 0x00u)
#define USART_CR3(usart) REG32((usart) + 0x08u)
#define USART_BRR(usart) REG32((usart) + 0x0Cu)
#define USART_ICR(usart) REG32((usart) + 0x20u)
#define USART_RDR(usart) REG32((usart) + 0x24u)
#define USART_TDR(usart) REG32((usart) + 0x28u)
#define USART_CR1_UE     (1u << 0)
#define USART_CR1_RE     (1u << 2)
#define USART_CR1_TE     (1u << 3)
#define USART_CR1_IDLEIE (1u << 4)
#define USART_CR3_EIE    (1u << 0)
#define USART_CR3_DMAR   (1u << 6)
#define USART_CR3_DMAT   (1u << 7)
#define USART_ICR_FECF   (1u << 1)
#define USART_ICR_NCF    (1u << 2)
#define USART_ICR_ORECF  (1u << 3)
#define USART_ICR_IDLECF (1u << 4)

/* ---- EXTI, chapter 11 ---- */
#define EXTI_BASE     0x40013C00u
#define EXTI_IMR      REG32(EXTI_BASE + 0x00u)
#define EXTI_RTSR     REG32(EXTI_BASE + 0x08u)
#define EXTI_IMR_MR16 (1u << 16) /* the supply's detector */

/* ---- ADC, chapter 15 ---- */
#define ADC1_BASE          0x40012000u
#define ADC2_BASE          0x40012100u
#define ADC_COMMON_BASE    0x40012300u
#define ADC_SR(adc)        REG32((adc) + 0x00u)
#define ADC_CR1(adc)       REG32((adc) + 0x04u)
#define ADC_CR2(adc)       REG32((adc) + 0x08u)
#define ADC_SMPR1(adc)     REG32((adc) + 0x0Cu)
#define ADC_SMPR2(adc)     REG32((adc) + 0x10u)
#define ADC_SQR1(adc)      REG32((adc) + 0x2Cu)
#define ADC_SQR3(adc)      REG32((adc) + 0x34u)
#define ADC_DR(adc)        REG32((adc) + 0x4Cu)
#define ADC_CCR            REG32(ADC_COMMON_BASE + 0x04u)
#define ADC_SR_OVR         (1u << 5)
#define ADC_CR1_OVRIE      (1u << 26)
#define ADC_CR2_ADON       (1u << 0)
#define ADC_CR2_DMA        (1u << 8)
#define ADC_CR2_DDS        (1u << 9)
#define ADC_CR2_EXTSEL_POS 24u
#define ADC_CR2_EXTEN_POS  28u
#define ADC_CR2_SWSTART    (1u << 30)
#define ADC_SR_EOC         (1u << 1)
#define ADC_SMPR2_SMP3_POS 9u
#define ADC_SQR3_SQ1_POS   0u
#define ADC_CCR_ADCPRE_POS 16u

/* ---- DMA, chapter 8; streams 0 to 3 have their flags in the low registers ---- */
#define DMA1_BASE             0x40026000u
#define DMA2_BASE             0x40026400u
#define DMA_LISR(dma)         REG32((dma) + 0x00u)
#define DMA_LIFCR(dma)        REG32((dma) + 0x08u)
#define DMA_CR(dma, stream)   REG32((dma) + 0x10u + 0x18u * (stream))
#define DMA_NDTR(dma, stream) REG32((dma) + 0x14u + 0x18u * (stream))
#define DMA_PAR(dma, stream)  REG32((dma) + 0x18u + 0x18u * (stream))
#define DMA_M0AR(dma, stream) REG32((dma) + 0x1Cu + 0x18u * (stream))
#define DMA_M1AR(dma, stream) REG32((dma) + 0x20u + 0x18u * (stream))
#define DMA_FCR(dma, stream)  REG32((dma) + 0x24u + 0x18u * (stream))
#define DMA_CR_EN             (1u << 0)
#define DMA_CR_DMEIE          (1u << 1)
#define DMA_CR_TEIE           (1u << 2)
#define DMA_CR_TCIE           (1u << 4)
#define DMA_CR_DIR_POS        6u
#define DMA_CR_CIRC           (1u << 8)
#define DMA_CR_MINC           (1u << 10)
#define DMA_CR_PSIZE_POS      11u
#define DMA_CR_MSIZE_POS      13u
#define DMA_CR_PL_POS         16u
#define DMA_CR_DBM            (1u << 18)
#define DMA_CR_CT             (1u << 19)
#define DMA_CR_CHSEL_POS      25u
#define DMA_LISR_FEIF0        (1u << 0)
#define DMA_LISR_DMEIF0       (1u << 2)
#define DMA_LISR_TEIF0        (1u << 3)
#define DMA_LISR_HTIF0        (1u << 4)
#define DMA_LISR_TCIF0        (1u << 5)
#define DMA_LISR_FEIF1        (1u << 6)
#define DMA_LISR_DMEIF1       (1u << 8)
#define DMA_LISR_TEIF1        (1u << 9)
#define DMA_LISR_HTIF1        (1u << 10)
#define DMA_LISR_TCIF1        (1u << 11)
#define DMA_LISR_FEIF3        (1u << 22)
#define DMA_LISR_DMEIF3       (1u << 24)
#define DMA_LISR_TEIF3        (1u << 25)
#define DMA_LISR_HTIF3        (1u << 26)
#define DMA_LISR_TCIF3        (1u << 27)

/* ---- general-purpose timers, chapter 26 ---- */
#define TIM2_BASE          0x40000000u
#define TIM3_BASE          0x40000400u
#define TIM5_BASE          0x40000C00u
#define TIM_CR1(tim)       REG32((tim) + 0x00u)
#define TIM_CR2(tim)       REG32((tim) + 0x04u)
#define TIM_SMCR(tim)      REG32((tim) + 0x08u)
#define TIM_EGR(tim)       REG32((tim) + 0x14u)
#define TIM_CCMR1(tim)     REG32((tim) + 0x18u)
#define TIM_CNT(tim)       REG32((tim) + 0x24u)
#define TIM_PSC(tim)       REG32((tim) + 0x28u)
#define TIM_ARR(tim)       REG32((tim) + 0x2Cu)
#define TIM_CCR1(tim)      REG32((tim) + 0x34u)
#define TIM_CR1_CEN        (1u << 0)
#define TIM_CR2_MMS_POS    4u
#define TIM_SMCR_SMS_POS   0u
#define TIM_SMCR_TS_POS    4u
#define TIM_EGR_UG         (1u << 0)
#define TIM_CCMR1_OC1M_POS 4u

/* ---- independent watchdog, chapter 30 ---- */
#define IWDG_BASE 0x40003000u
#define IWDG_KR   REG32(IWDG_BASE + 0x00u)
#define IWDG_PR   REG32(IWDG_BASE + 0x04u)
#define IWDG_RLR  REG32(IWDG_BASE + 0x08u)
#define IWDG_SR   REG32(IWDG_BASE + 0x0Cu)

/* RM0410 40.16: what stands still while a debugger halts the processor */
#define DBGMCU_BASE             0xE0042000u
#define DBGMCU_APB1FZ           REG32(DBGMCU_BASE + 0x08u)
#define DBGMCU_APB1FZ_IWDG_STOP (1u << 12)

/* ---- unique device identifier, 96 bits, section 45.1 ---- */
#define UID_BASE  0x1FF0F420u
#define UID(word) REG32(UID_BASE + 4u * (word))

/* ---- core: SysTick, NVIC, system control, MPU, caches (PM0253 chapter 4) ---- */
#define STK_BASE           0xE000E010u
#define STK_CTRL           REG32(STK_BASE + 0x00u)
#define STK_LOAD           REG32(STK_BASE + 0x04u)
#define STK_VAL            REG32(STK_BASE + 0x08u)
#define STK_CTRL_ENABLE    (1u << 0)
#define STK_CTRL_TICKINT   (1u << 1)
#define STK_CTRL_CLKSOURCE (1u << 2)

#define NVIC_BASE       0xE000E100u
#define NVIC_ISER(word) REG32(NVIC_BASE + 0x000u + 4u * (word))
#define NVIC_ICPR(word) REG32(NVIC_BASE + 0x180u + 4u * (word))
#define NVIC_IPR(irq)   (*(volatile uint8_t *)(NVIC_BASE + 0x300u + (irq)))

#define SCB_BASE              0xE000ED00u
#define SCB_ICSR              REG32(SCB_BASE + 0x04u)
#define SCB_VTOR              REG32(SCB_BASE + 0x08u)
#define SCB_AIRCR             REG32(SCB_BASE + 0x0Cu)
#define SCB_CCR               REG32(SCB_BASE + 0x14u)
#define SCB_SHPR3             REG32(SCB_BASE + 0x20u)
#define SCB_SHCSR             REG32(SCB_BASE + 0x24u) /* SHCRS in some SVD files */
#define SCB_CFSR              REG32(SCB_BASE + 0x28u)
#define SCB_HFSR              REG32(SCB_BASE + 0x2Cu)
#define SCB_MMFAR             REG32(SCB_BASE + 0x34u)
#define SCB_BFAR              REG32(SCB_BASE + 0x38u)
#define SCB_CSSELR            REG32(SCB_BASE + 0x84u)
#define SCB_CPACR             REG32(SCB_BASE + 0x88u)
#define SCB_ICIALLU           REG32(SCB_BASE + 0x250u)
#define SCB_DCIMVAC           REG32(SCB_BASE + 0x25Cu)
#define SCB_DCISW             REG32(SCB_BASE + 0x260u)
#define SCB_AIRCR_SYSRESETREQ (0x05FA0000u | (1u << 2)) /* with the key */
#define SCB_CCR_DIV_0_TRP     (1u << 4)
#define SCB_CCR_DC            (1u << 16)
#define SCB_CCR_IC            (1u << 17)
#define SCB_SHCSR_MEMFAULTENA (1u << 16)
#define SCB_SHCSR_BUSFAULTENA (1u << 17)
#define SCB_SHCSR_USGFAULTENA (1u << 18)
#define SCB_CFSR_MSTKERR      (1u << 4)
#define SCB_CFSR_MMARVALID    (1u << 7)
#define SCB_CFSR_STKERR       (1u << 12)
#define SCB_CFSR_BFARVALID    (1u << 15)

#define MPU_BASE            0xE000ED90u
#define MPU_CTRL            REG32(MPU_BASE + 0x04u)
#define MPU_RNR             REG32(MPU_BASE + 0x08u)
#define MPU_RBAR            REG32(MPU_BASE + 0x0Cu)
#define MPU_RASR            REG32(MPU_BASE + 0x10u)
#define MPU_CTRL_ENABLE     (1u << 0)
#define MPU_CTRL_PRIVDEFENA (1u << 2)

#define DCB_DEMCR          REG32(0xE000EDFCu)
#define DCB_DEMCR_TRCENA   (1u << 24)
#define DWT_BASE           0xE0001000u
#define DWT_CTRL           REG32(DWT_BASE + 0x00u)
#define DWT_CYCCNT         REG32(DWT_BASE + 0x04u)
#define DWT_LAR            REG32(DWT_BASE + 0xFB0u)
#define DWT_CTRL_CYCCNTENA (1u << 0)

/* ---- interrupts, table 46 ---- */
#define IRQ_PVD          1u
#define IRQ_DMA1_STREAM1 12u
#define IRQ_DMA1_STREAM3 14u
#define IRQ_ADC          18u
#define IRQ_USART3       39u
#define IRQ_DMA2_STREAM0 56u
#define IRQ_COUNT        110u

#endif

"""An emulated NUCLEO-F767ZI: the unmodified firmware image, byte for byte what is flashed, on a
Cortex-M7 (Unicorn), peripherals by registers, simulated analog parts. The same image, model, scene
and commands give the same bytes on any computer; images and touches have the host's bits.

    clocks (RCC, PLL) ── MCO1 8 MHz ──> AD9833 <── SPI3 words, mode and FSYNC as they are
                                          │ phase accumulator
    TIM5 ─> TIM3 ─> TIM2 ─> ADC1 <── converter <── lag 1.5 us <── skin <── ADG1206 x 4 <── GPIO E, F
                              │ DMA2 (two buffers, interrupts as levels)      └─ scene's voltages
                            memory ─> firmware ─> DMA1 ─> USART3 ─> 1 Mbaud ─> host

Time is the board's: slots, samples and bits on wires are whole ticks of 1/432 MHz. The processor
takes one cycle an instruction, which is an assumption. Flash erases a sector of 256 KB in 1 s and
programs a word in 16 us; the processor stands still meanwhile.

The skin gives each row of the scene's frames when just these electrodes are joined, with the sign
of exchanged pairs; anything else joined gives 0 V. Before the scene begins it repeats the untouched
frames, one a scan. Then the frame is floor(t x rate), decided when a scan begins, and where touches
move each row is that of the instant at which the board switches to it; the last frame is held.
Noise is the scene's; its ``adc`` effect is left to the emulated converter. Settling is one
first-order lag from row to row, 1.5 us; a scene's ``mux`` effect comes on top.

Each file says at its head what it models and what not: caches, double precision, low-power modes,
the time of DMA transfers, the converter's errors, parity and noise on the serial line, and
resistance, charge and leakage of the multiplexers (scenes have effects for these) among it. The
board counts accesses to what is not modelled or has no clock, orders that the manual forbids, and
multiplexers that may have joined two electrodes; the tests ask that there are none:
``open_emulated(scene).board.report()``.
"""

"""The STM32F767's peripherals, one file each, as the reference manual RM0410 tells them; each says
what it leaves out."""

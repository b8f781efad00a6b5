"""The STM32F767's peripherals, one file each, as the reference manual RM0410 describes them; each
file states what it leaves out."""

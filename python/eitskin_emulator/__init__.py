"""An emulated NUCLEO-F767ZI: the unmodified firmware image, peripherals by registers, simulated
analog parts; docs/guide/emulated-board.md.
"""

"""The parts at the processor's pins: generator, multiplexers, skin, converter's input; each module
states what it leaves out."""

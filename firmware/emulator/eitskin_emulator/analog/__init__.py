"""The parts at the processor's pins: generator, multiplexers, skin, converter's input; each says
what it leaves out."""

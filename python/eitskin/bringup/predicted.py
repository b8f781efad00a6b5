"""Predictions by the simulation of the circuit (ngspice), with their names in
``hardware/made/results.json``; a test compares them."""

SINE_PP_V = 0.612  # sine_pp_v: at the generator's output
CONVERTER_BIAS_V = 1.65  # converter_bias_v
CONVERTER_GAIN = 3.0  # converter_gain: from the electrodes to the converter
SOURCE_1K_V = 0.499  # source_1k_v: amplitude over 1 kohm
SOURCE_10K_V = 4.93  # source_10k_v: over 10 kohm
SETTLE_US = 4.4  # receiver_settle_s: to half a bit of 12
SUPPLY_GOOD_V = 3.24  # supply_good_v: at PC11
SOURCE_UA, CODE_V, MIDDLE = 500.0, 3.3 / 4096, 2048.0

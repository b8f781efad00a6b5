"""Calibration of force: the list of known weights, the presses in a recording, and the fit of a law
from strength to force."""

"""A model learned from presses at known places: their file, the fit, its report."""

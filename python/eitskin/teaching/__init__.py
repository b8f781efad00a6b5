"""Teaching: learn a model from presses at known places; the file of presses, the fit, and its
report."""

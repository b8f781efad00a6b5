"""Measured operating points of the trade-off between accuracy and cost, and the choice of one by a
preset or by limits."""

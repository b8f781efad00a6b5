"""Boards: real ones, simulated ones, emulated ones, and recordings of them, behind one set of
commands."""

"""``eitskin bench``: speed side by side, and what diagnostics are worth."""

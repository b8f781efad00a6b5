"""``eitskin bench``: speed side by side, and what findings are worth."""

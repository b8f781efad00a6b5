"""``eitskin reconstruct``: its steps, and what it says of them."""

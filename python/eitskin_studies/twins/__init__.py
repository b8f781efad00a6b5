"""Numpy twins of those parts of the core that no engine of the product runs in numpy: the fast path
and gestures. Tests and studies compare the core with them."""

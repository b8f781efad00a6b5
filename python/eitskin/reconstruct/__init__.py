"""The steps of ``eitskin reconstruct``, and its report."""

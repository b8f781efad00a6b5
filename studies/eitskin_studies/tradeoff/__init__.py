"""The cost of accuracy in time: configurations over one scale, measured on the same scenes, and
which to choose."""

"""The numpy reference of the fast path (csrc/src/fast): touches after each drive of a scan."""

"""Collectors and checks of a session's frames: raw frames for files, a board's data for the doctor,
and whether a board computes the same bits as this host."""

"""What is collected from a session's frames, or checked with them: raw frames for files, a board
before the doctor, and whether a board computes the same bits as this host."""

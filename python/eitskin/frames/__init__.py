"""Frames: the file that holds boundary voltages, the import of other people's files, and the
doctor."""

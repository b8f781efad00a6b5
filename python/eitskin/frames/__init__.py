"""Frames of boundary voltages: their file, the import of files from other instruments, and the
doctor that examines them."""

"""Shared by experiments and benchmarks: runs on the emulated core, stored results, page
sections."""

"""Runs kept: as packets on disk or in memory, as frames, and held against this host bit by bit."""

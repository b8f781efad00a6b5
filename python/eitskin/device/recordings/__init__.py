"""Runs kept: as packets on disk or in memory, as frames, and compared with this host bit by bit."""

"""Touches and the frames they would give."""

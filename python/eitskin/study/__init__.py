"""Judging and comparing: metrics, the comparison of methods."""

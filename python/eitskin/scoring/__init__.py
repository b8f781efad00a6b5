"""Judging: metrics of images, matching of touches, summaries."""

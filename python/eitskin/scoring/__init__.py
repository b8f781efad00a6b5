"""Score reconstructions: metrics of images, matching of touches, and summaries."""

"""``sim:``: a board in Python that speaks the very bytes of the link, over the host core."""

"""A skin as it is touched: a session with a board, its frames, and the messages that tell of
them."""

"""A session with a board: the one path of its frames from the transport to every consumer."""

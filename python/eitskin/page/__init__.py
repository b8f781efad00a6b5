"""The live page: a session with a board, served to browsers."""

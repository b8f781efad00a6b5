"""``eitskin compare``: all methods on the same scenes."""

"""Where touches go: a file a sink, found by the entry points of the group ``eitskin.sinks``."""

"""Send touches to other programs: a file per sink, found by the entry points of the group
``eitskin.sinks``."""

"""The commands that join `eitskin` where the studies are installed."""

"""The instrument's hardware: its circuit as code, the documents made from it, its simulation by
ngspice, and the skin's container."""

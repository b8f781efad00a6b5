"""The instrument's hardware: its circuit as code, what is made from it, its simulation by ngspice,
and the skin's container."""

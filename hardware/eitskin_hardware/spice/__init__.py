"""The circuit in ngspice: macro models, the deck of a design, and its measurements."""

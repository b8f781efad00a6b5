"""eitskin: electrical impedance tomography skins, from a skin's description to touches."""

__version__ = "0.1.0"

"""The demonstration: three simulated touches, reconstructed on the host and on an emulated
board."""

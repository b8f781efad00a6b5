"""A skin's own law from strength to load, learned from known weights: their list, the presses in a
recording, the fit."""

"""Random gestures of fingers on a skin: drawn, simulated, and reported ones judged by the truth."""

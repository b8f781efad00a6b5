"""Random gestures of fingers on a skin: drawn, simulated, and told ones judged by the truth."""

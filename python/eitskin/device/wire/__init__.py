"""The link: packets, their layouts and codec, sequence numbers, and what numbers mean in words."""

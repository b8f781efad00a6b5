"""Draw pictures and films of skins, images and touches."""

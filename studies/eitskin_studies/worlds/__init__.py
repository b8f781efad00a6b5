"""Other worlds: scenes that the model does not share, and how well touches are counted in them."""

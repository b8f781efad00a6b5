"""The container of a skin: a dish with a post through its wall at each electrode."""

"""Budgets: the points of the trade-off that nothing beats, and the settings that fit a time or an
accuracy."""

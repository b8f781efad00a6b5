"""Scenes: touches on a simulated skin, and the frames that they produce."""

"""Robots: which skins they have, and where these are."""

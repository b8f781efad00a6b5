"""The firmware image that ships with the package, for whoever has no cross compiler, and the
manifest of what it was built from.

Made by ``scripts/firmware --prebuilt``; a test builds it again and compares.
"""

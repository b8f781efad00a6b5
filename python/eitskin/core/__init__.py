"""The C core through cffi: its two compiled modules, the engine around them, and the types of its
inputs and results.

It uses no other package of eitskin except errors.
"""

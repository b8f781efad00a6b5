"""The C core through cffi: its two modules, the engine around them, what goes in and what comes
out.

It knows no other package of eitskin but the errors.
"""

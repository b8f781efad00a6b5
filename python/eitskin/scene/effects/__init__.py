"""The built-in effects, one a file; a file is imported only when a scene names its effect
(``scene/registry.py``)."""

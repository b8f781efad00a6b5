"""The built-in effects, one per file; a file is imported only when a scene names its effect
(``scene/registry.py``)."""

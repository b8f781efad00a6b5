"""Skins on triangulated surfaces: meshes, their flattened copies, and the map between the two."""

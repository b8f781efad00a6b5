"""Frames of reference: poses, and the links of a URDF with their meshes."""

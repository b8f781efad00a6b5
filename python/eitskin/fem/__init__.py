"""Forward modelling: image grid, mesh, complete electrode model and sensitivity. scipy and netgen
are needed only by those who use this module."""

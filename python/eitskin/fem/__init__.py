"""The model path: grid, mesh, complete electrode model, sensitivity. Only its users need scipy and
netgen."""

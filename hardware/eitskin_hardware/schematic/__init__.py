"""The schematic, drawn from the design by stage."""

"""The Visual Mesh: rings, grids and their variants."""

"""The training of the close look: a small network that judges the proposals of a mesh network."""

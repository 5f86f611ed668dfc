"""How a network learns: recipe, point selection, optimizer, rounds and the folder of a run."""

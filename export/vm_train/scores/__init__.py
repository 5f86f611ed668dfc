"""How good answers are: scores of points and of objects, by distance."""

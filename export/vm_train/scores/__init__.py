"""Scores of points and of objects, by distance: precision, recall, curves, and errors of distance."""

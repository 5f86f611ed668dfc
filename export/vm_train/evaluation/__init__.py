"""Scores of a network on pictures, as tables, plots and a report."""

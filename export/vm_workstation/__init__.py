"""Shared by the programs that run on a workstation: arguments, ranges, worker processes, tables, plots and pictures."""

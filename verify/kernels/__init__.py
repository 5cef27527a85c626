"""Compiled loops of the witness; they import numpy, numba and math only."""

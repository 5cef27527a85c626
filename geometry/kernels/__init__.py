"""Compiled loops. They import numpy, numba and math only and never raise."""

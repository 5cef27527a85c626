"""The material model of the proof: stock lines, stock field, collisions, the machined part.

It does not use the stock and drop kernels of the planner.
"""

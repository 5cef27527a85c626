"""The material model of the proof: stock lines, stock field, collisions, the machined part.

The planner's stock and drop kernels are not used.
"""

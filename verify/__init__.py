"""The independent proof: it reads a program, simulates it and returns findings.

It imports ``geometry`` only, and never the drop kernels that the planner uses.
"""

"""Shapes and arithmetic: STEP reader, meshes, surfaces, tool bodies.

Nothing of milling is known here: no zone, path, stock or machine.
"""

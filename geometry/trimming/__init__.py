"""Faces of the mesh cut where a label changes, with smooth borders.

The meaning of the labels belongs to the callers.
"""

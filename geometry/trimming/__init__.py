"""Faces of the mesh cut where a label changes, with smooth borders.

What the labels mean is not known here.
"""

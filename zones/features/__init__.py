"""Walls, connections and channels found on the faces of a part.

Tools do not belong here.
"""

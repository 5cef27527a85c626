"""Walls, connections and channels found on the faces of a part.

No tool is known here.
"""

"""Walls, connections, channels and the machinable zones between cutting planes.

No path is laid here, and no stock is known.
"""

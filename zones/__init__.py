"""Walls, connections, channels and the machinable zones between cutting planes."""

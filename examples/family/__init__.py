"""The family of test parts with known features: recipes, walls, connections, gaps, joins.

The product does not depend on it; only the demo and ``zonemill family`` call it.
"""

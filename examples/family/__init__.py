"""The family of test parts with known truth: recipes, walls, connections, gaps, joins.

Nothing of the product depends on it; only the demo and ``zonemill family`` call it.
"""

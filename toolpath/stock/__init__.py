"""The planner's own model of the stock: what is left, what was cut, what a tool engages.

The proof never uses it: ``verify`` has a model of its own.
"""

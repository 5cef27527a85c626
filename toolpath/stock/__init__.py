"""The planner's own model of the stock: residual material, earlier cuts, engagement of a tool.

The proof never uses it: ``verify`` has a model of its own.
"""

"""Wire models: everything that travels as JSON, each number with its unit in its name.

No rule of planning stands here; only ``service`` imports these models.
"""

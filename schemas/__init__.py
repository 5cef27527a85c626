"""Wire models: what travels as JSON, every number with its unit in its name."""

"""Tool libraries of other systems: read into entries of one form, turned into tools of a setup, and written."""

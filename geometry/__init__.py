"""Shapes and arithmetic; knows nothing of milling."""

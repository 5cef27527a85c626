"""Zones: cutting planes, patches and the share of each tool.

Paths are laid in ``toolpath``.
"""

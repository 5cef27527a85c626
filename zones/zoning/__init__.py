"""Zones: cutting planes, patches and the share of each tool.

Paths belong to ``toolpath``.
"""

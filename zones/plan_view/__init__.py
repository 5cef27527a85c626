"""The plan view along an access: sections, strips, cells and regions.

Depth and tools belong to ``zoning`` and ``reach``.
"""

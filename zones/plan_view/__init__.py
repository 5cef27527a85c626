"""The plan view along an access: sections, strips, cells and regions.

Depth and tools come later, in ``zoning`` and ``reach``.
"""

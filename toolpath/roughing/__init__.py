"""Roughing lines with bounded engagement, and walls that need no rim.

The depth layers that use them stand in ``strategies``.
"""

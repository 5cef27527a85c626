"""Roughing lines with bounded engagement, heights and areas of layers, and walls that need no rim.

The depth layers that use them stand in ``strategies``.
"""

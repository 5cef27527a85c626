"""Roughing lines with bounded engagement.

The depth layers that use them stand in ``strategies``.
"""

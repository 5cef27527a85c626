"""The order of a whole job and the choice of a strategy for each zone.

Geometry of passes stands in ``passes``, ``strategies`` and ``five_axis``.
"""

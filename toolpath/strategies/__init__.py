"""One cutting strategy a module: each turns a zone into cutter-location passes.

The choice between strategies stands in ``planning``, the geometry of passes in ``passes`` and ``five_axis``.
"""

"""Tool axes that tilt: oriented passes, flank milling, curvature matching, axis smoothing.

Which zone gets which strategy is decided in ``planning``.
"""

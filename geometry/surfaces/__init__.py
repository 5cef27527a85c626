"""B-spline and NURBS surfaces, their derivatives and foot points.

Trimming has its own folder.
"""

"""B-spline and NURBS surfaces, their derivatives and foot points.

No mesh is made here; trimming has its own folder.
"""

"""Rest material and gouges on the surface of the part: residuals, gouge depths, scores by zone and face.

Collisions are in ``material``.
"""

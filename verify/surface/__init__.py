"""What a program leaves on the surface of the part: residual, gouges, scores by zone and face.

Collisions stand in ``material``.
"""

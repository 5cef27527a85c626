"""Questions asked of a triangle mesh: rays, nearest places, lowest tips, pushes, overlaps.

Only shapes are known here: no STEP file, no part, no plan.
"""

"""Queries on a triangle mesh: rays, nearest places, lowest tips, pushes, overlaps.

Only shapes belong here: no STEP file, no part, no plan.
"""

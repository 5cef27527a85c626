"""A program as the proof sees it: moves, arcs as chords, times, axes.

How a control spells them is not known here.
"""

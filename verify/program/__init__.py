"""A program as the proof takes it: moves, arcs as chords, times, axes.

The words of controls are not known here.
"""

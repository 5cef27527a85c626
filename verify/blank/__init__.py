"""Blanks of the proof and the ways out of them.

No program is read here.
"""

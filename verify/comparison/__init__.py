"""Compares the motion of two programs, or of a program and a STEP-NC file.

Nothing is simulated here.
"""

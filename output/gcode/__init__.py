"""Programs in the words of each control, written from one workplan.

Nothing here reads a program back: that is the work of ``verify``.
"""

"""Programs in the language of each control, written from one workplan.

Nothing here reads a program back; ``verify`` does that.
"""

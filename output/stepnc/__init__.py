"""STEP-NC files (AP238 and ISO 14649), written from the same workplan as the programs.

Nothing here reads a file back; ``verify`` does that.
"""

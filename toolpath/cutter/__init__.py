"""The cutter as a shape: its profile and the envelope it sweeps.

No path is planned here.
"""

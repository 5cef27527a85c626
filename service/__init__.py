"""HTTP, command line, jobs and the engine: the only layer that may import all others.

Here live settings, the pipeline and its rooms. Geometry, planning and simulation do not live here.
"""

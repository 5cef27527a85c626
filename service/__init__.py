"""Command line, HTTP, jobs and the pipeline: the only package that may import all others.

No geometry is computed here.
"""

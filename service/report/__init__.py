"""The report of a job: figures, remainder, tool proposals, approach cones.

No file is written here.
"""

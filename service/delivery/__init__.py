"""The files of a job: report, programs, STEP-NC, machined part, and how they are written whole or not at all.

Nothing is planned or proved here. How a picture, a sheet or a view file is drawn stands in the rooms beside it.
"""

"""The stages of the pipeline: from the converted setup to the files of a finished job.

No HTTP and no job table is known here.
"""

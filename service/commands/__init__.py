"""The commands of the command line that need more than a call into the pipeline.

No planning and no HTTP route stands here.
"""

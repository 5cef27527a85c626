"""Commands of the command line that need more than a call into the pipeline.

Planning and HTTP routes do not live here.
"""

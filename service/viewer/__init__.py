"""The data and static files of the page that shows a job.

The page itself is written in ``web``.
"""

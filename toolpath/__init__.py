"""Tool paths: cutters, passes, strategies, linking and the plan of a job.

Nothing is written in the words of a control here, and nothing is proved.
"""

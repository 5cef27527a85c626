"""The job table, artifacts, workers, and the child processes that run jobs.

``service.pipeline`` and ``service.stages`` compute the results of a job; nothing is planned here.
"""

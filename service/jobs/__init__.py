"""The job table, artifacts, workers and child processes that run jobs.

What a job computes stands in ``service.pipeline`` and ``service.stages``.
"""

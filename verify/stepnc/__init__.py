"""The reader of STEP-NC files in both forms, ISO 14649 and AP238.

Nothing here comes from the writers in ``output``.
"""

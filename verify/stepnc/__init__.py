"""The reader of STEP-NC files in both forms.

Nothing here comes from the writers in ``output``.
"""

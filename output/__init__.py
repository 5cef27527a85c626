"""Programs and STEP-NC files, written from one workplan.

Nothing is planned here, and nothing that was written is read back.
"""

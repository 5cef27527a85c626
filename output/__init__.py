"""Programs and STEP-NC files written from a workplan."""

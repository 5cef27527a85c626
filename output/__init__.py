"""Programs and STEP-NC files, written from a workplan.

Here live the workplan, the arc fitting, the inverse kinematics and the writers. Readers of programs do not live here:
``verify`` has its own, so that an error of a writer is not read back as correct.
"""

"""What a job will take: an estimate of memory and time from part and setup, and the room that the machine has for it.

docs/scale.md has the calibration.
"""

"""Whether two programs, or a program and a STEP-NC file, describe the same motion.

Nothing is simulated here.
"""

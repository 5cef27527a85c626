"""The verification of one program of any origin: read it first, find the faces it is asked for, prove it.

No planning and no zones here: those are stages of jobs.
"""

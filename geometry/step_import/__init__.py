"""The door to STEP files: text checks, the reading child process and the surfaces of its faces.

Only ``occ`` below this folder calls the CAD kernel.
"""

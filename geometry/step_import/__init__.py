"""Import of STEP files: text checks, the reading child process and the surfaces of the faces.

Only ``occ`` below this folder calls the CAD kernel.
"""

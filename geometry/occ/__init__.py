"""Everything that touches the CAD kernel. Import it inside a child process only.

reading   STEP file -> kernel shape in mm
healing   one valid closed solid out of what the file holds
meshing   solid -> watertight triangles with face numbers, and their distance to the exact surface
curvature what each face is and how it bends
edges     how faces meet
loading   all of it in order
"""

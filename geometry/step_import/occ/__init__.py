"""What runs inside the reading child process: reading, healing, measuring and meshing with the CAD kernel.

No other folder of the product imports OCP. ``loading`` calls the others in this order:

- ``reading``: STEP file to the kernel shapes of its products, in mm and in their places
- ``solid.healing``: one valid closed solid
- ``meshing``: watertight triangles with face numbers, and their distance from the exact surface
- ``curvature``: kind and curvature of each face
- ``edges``: how faces meet
"""

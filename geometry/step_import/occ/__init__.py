"""What runs inside the reading child process: reading, healing, measuring and meshing with the CAD kernel.

No other folder of the product imports OCP.
"""

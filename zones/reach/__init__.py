"""What an assembly of tool and holder can touch along an access.

It rests on one kernel, the lowest tip height over a mesh.
"""

"""Area that an assembly of tool and holder can touch along an access.

All of it uses one kernel, the lowest tip height over a mesh. The choice of tools belongs to ``zoning``.
"""

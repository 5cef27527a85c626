"""Links between passes: lead arcs, ramps, rapids, and the linker that keeps them safe.

No cutting pass is laid here.
"""

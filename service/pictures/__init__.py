"""Pictures drawn in memory: cameras, rasterizer, annotations, deviation maps, tool drawings.

Nothing here decides what a job is worth.
"""

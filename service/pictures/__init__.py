"""Pictures drawn in memory: cameras, rasterizer, annotations, deviation maps, tool drawings.

Pictures show results; nothing is planned, proved or judged here.
"""

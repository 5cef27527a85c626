"""Parametric test parts with known features: walls, blades, struts and the connections between them.

Here live the demo part, suggested setups, client scripts and the part family. No rule of planning or proof lives here.
"""

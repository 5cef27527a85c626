"""Four-sided grids and smooth maps on trimmed faces, so that passes can run along parameters.

Tools and tool paths do not belong here.
"""

"""Four-sided grids and smooth maps on trimmed faces, so that passes can run along parameters.

No tool and no tool path is known here.
"""

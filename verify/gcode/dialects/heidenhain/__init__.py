"""Words of Heidenhain as blocks of the common reader: Q parameters, labels, frames, contours, cycles.

Nothing here is used by another control.
"""

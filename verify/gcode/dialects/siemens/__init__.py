"""Words of Siemens 840D as blocks of the common reader: values and order, frames, corners, cycles, orientations.

Nothing here is used by another control.
"""

"""Cutting passes on one zone: contours, cutter locations, side step, forward step, pass order.

No link, feed or stock appears here.
"""

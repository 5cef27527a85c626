"""What no tool reaches, for which reason, and which tool would.

Nothing here changes a zone.
"""

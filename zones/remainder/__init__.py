"""Area that no tool reaches, with the reason, and the tool that reaches it.

Nothing here changes a zone.
"""

"""Feeds along a path, machining times and tool life.

No path is moved here.
"""

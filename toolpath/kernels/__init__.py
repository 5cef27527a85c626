"""Compiled loops of the toolpath layer."""

"""Compiled loops of the zones layer."""

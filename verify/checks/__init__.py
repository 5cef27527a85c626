"""Checks of a program that need no removal of stock: machine limits, order, repeats, table, clearance.

Each returns findings with line numbers.
"""

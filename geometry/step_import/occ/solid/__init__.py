"""From the products of a file to one valid closed solid: which of them is meant, where they meet, what is healed.

Nothing is meshed or measured here beyond what decides that.
"""

"""Cutters, contact, strategies, linking and the plan of a job."""

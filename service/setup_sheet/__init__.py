"""The setup sheet of a job as HTML and PDF.

It shows figures of the report and computes none of its own.
"""

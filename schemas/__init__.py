"""Wire models: the JSON that clients send and receive, with the unit of every number in its name.

Here live the models of setup, report, zones, jobs and errors, and their checks. Nothing here plans, proves or reads a
file.
"""

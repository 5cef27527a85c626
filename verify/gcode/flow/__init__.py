"""Order and values of a program: calls, loops, jumps, variables and expressions of LinuxCNC, Fanuc and Haas.

No axis moves here: what comes out is blocks of plain words in the order in which they run.
"""

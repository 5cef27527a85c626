"""The reader of programs: words, modes, parameters, cycles and motion of five controls.

Nothing here comes from the writers in ``output``.
"""

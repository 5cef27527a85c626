"""The real chain with a writer that ends every program with a cut half a mm into the floor of the small step part."""

import service.pipeline as chain
import service.stages.programs as programs

write = programs.write_program


def gouging(work, dialect):
    text = write(work, dialect)
    at = text.rindex("\nM5\n")
    return f"{text[:at]}\nG0 X3 Y6\nG1 Z1.5 F100\nG1 X4\nG0 Z30{text[at:]}"


programs.write_program = gouging
plan, zones_only, verify_program = chain.plan, chain.zones_only, chain.verify_program

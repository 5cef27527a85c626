"""HTTP, command line, jobs and the engine: the only layer that may import all others."""

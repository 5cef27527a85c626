"""One cutting strategy a module: each turns a zone into cutter-location passes."""

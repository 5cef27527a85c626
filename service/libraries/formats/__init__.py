"""The formats of tool libraries: each module turns bytes into entries, and entries into bytes."""

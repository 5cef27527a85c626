"""The cache of compiled kernels: its folders, and the sources that the key of each entry is a digest of."""

"""NumPy references of the compiled kernels: as close to the equations as can be."""

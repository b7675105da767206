"""Transport: counter-based random numbers and samplers for Monte Carlo; plain float64 scalar Numba code."""

"""Optics: phase functions, each normalised to 1 over the sphere, with scattering cosine 1 forward."""

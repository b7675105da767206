"""Real OpenGL builds of the techniques, and their comparison with the mirror."""

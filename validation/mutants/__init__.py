"""Broken variants of the GL builds, which `check` must catch and name."""

"""Look-up tables: coordinates, builder and look-up of each in one file."""

"""atmoref: CPU reference of published GPU methods for light in the atmosphere."""

__version__ = "0.1.0"

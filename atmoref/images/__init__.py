"""Image files: EXR, NPZ, NPY, PNG and PFM, and what turns radiance into a picture."""

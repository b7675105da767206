"""Image files: EXR, NPZ, NPY, PNG and PFM, and what turns radiance into a picture."""

from atmoref.images.files import READABLE, WRITABLE, read, write
from atmoref.images.image import MAX_BYTES, Image, ImageError, TooLarge, from_rgb
from atmoref.images.tone import display_codes, srgb_decode, srgb_encode

__all__ = [
    "MAX_BYTES",
    "READABLE",
    "WRITABLE",
    "Image",
    "ImageError",
    "TooLarge",
    "display_codes",
    "from_rgb",
    "read",
    "srgb_decode",
    "srgb_encode",
    "write",
]

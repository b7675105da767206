"""Reference packs: everything that a test on a GPU needs, without Python."""

from atmoref.export.pack import PackError, export_pack

__all__ = ["PackError", "export_pack"]

"""Published techniques, a paper each: from scene to passes.  `render` runs one; `TECHNIQUES` names them all."""

from __future__ import annotations

from typing import Final

TECHNIQUES: Final = ("beams", "beams_vertex", "beams_interleaved")
"""A technique is a module of this room with NAME, Parameters, BUFFERS and build."""

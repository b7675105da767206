"""``atmoref export``: a reference pack for tests without Python."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from atmoref.cli.failures import RequestError
from atmoref.cli.rendering import Changes, SceneWord, TechniqueWord


def export(
    scene: SceneWord,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="A new directory, or an earlier pack.")],
    technique: TechniqueWord = None,
    changes: Changes = None,
) -> None:
    """Write what a GPU test of SCENE needs: textures, uniforms, every draw's reference and bounds, hashes."""
    from atmoref.cli.progress import working
    from atmoref.cli.quick_start import load_numba_without_blas
    from atmoref.scene import load_scene

    question = load_scene(scene, changes or ())
    load_numba_without_blas()
    from atmoref.export import PackError, export_pack

    try:
        with working(f"export {question.name}"):
            manifest = export_pack(question, output, technique=technique)
    except PackError as error:
        raise RequestError(str(error)) from None
    typer.echo(f"wrote {len(manifest['textures'])} textures and {len(manifest['stages'])} stages to {output}", err=True)

"""The verdict of `check` as JSON and as a table."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from atmoref.judge.check import CheckVerdict  # its room compiles kernels


MOST_LISTED = 24


def check_json(verdict: CheckVerdict) -> dict[str, Any]:
    """Return everything as plain values for JSON; `envelope` is null where no interval is derived."""
    first, cause = verdict.first, verdict.cause
    return {
        "verdict": "passed" if verdict.passed else "failed",
        "directory": verdict.directory, "scene": verdict.scene, "technique": verdict.technique,
        "device": verdict.device, "first": None if first is None else first.name,
        "diagnosis": None if cause is None else asdict(cause),
        "envelope": verdict.envelope,
        "end_to_end": None if verdict.end_to_end is None else _finite(asdict(verdict.end_to_end)),
        "notes": list(verdict.notes),
        "draws": [_finite(asdict(draw)) | {"diagnosis": draw.diagnosis} for draw in verdict.draws],
    }  # fmt: skip


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def check_table(verdict: CheckVerdict) -> str:
    """Return the verdict as text: the first draw that left, why, the rest, and the way from end to end."""
    judged = f"{len(verdict.draws)} buffers judged, each on the build's own previous ones"
    lines = [
        f"verdict      {'passed' if verdict.passed else 'failed'}",
        f"scene        {verdict.scene}, {verdict.technique}, device {verdict.device}; {judged}",
    ]
    first = verdict.first
    if first is not None and verdict.envelope is not None:
        within = "lies within" if verdict.envelope else "leaves"
        lines.append(f"envelope     the build {within} what any device may store that the specifications permit")
    if first is not None:
        lines.append(f"first        {first.name}: {first.outside} of {first.pixels} pixels outside, {first.off} differ")
        if first.worst is not None:
            lines.append(f"             {first.worst}")
        if verdict.cause is not None:
            lines.append(f"diagnosis    {verdict.cause}")
        failed = [draw for draw in verdict.draws if not draw.passed]
        for draw in failed[:MOST_LISTED]:
            lines.append(
                f"failed       {draw.name} ({draw.format}, {draw.allowed}): {draw.outside} outside, {draw.off} off"
            )
            lines += [f"             {told}" for told in draw.explanations]
        if len(failed) > MOST_LISTED:
            lines.append(f"             and {len(failed) - MOST_LISTED} more")
    end = verdict.end_to_end
    if end is not None:
        lines.append(f"end to end   {end.draw}: {end.off} of {end.pixels} pixels differ (reported, not judged)")
        if end.worst is not None:
            lines.append(
                f"             x {end.worst.x}, y {end.worst.y}: {end.worst.build:.7g}, not {end.worst.mirror:.7g}"
            )
    lines += [f"note         {note}" for note in verdict.notes]
    return "\n".join(lines)

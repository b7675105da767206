"""Tables of multiply scattered light as textures: EXR, KTX2, raw texels with a sidecar, NPZ.

Columns are scattering angles from 0 to 180 degrees, samples on both ends; row 0 is light scattered once.  Beside the
texture stands a JSON file with everything that is no texel: angles, wavelengths, f^n, F_n, scales of unorm rows.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.device import DEVICES
from atmoref.buffers.formats import encode, named
from atmoref.export.ktx2 import write_ktx2
from atmoref.images import Image, write
from atmoref.store import atomic_path, write_npz
from atmoref.tables.scattered import Scattered

__all__ = ["write_orders"]


def write_orders(path: Path, table: Scattered, name: str, storage: str = "float32") -> None:
    """Write a table; see the module's text.  `storage` is the format of a KTX2 file; the others hold float32.

    Raises
    ------
    ValueError
        For a KTX2 of more than four wavelengths.
    OSError
        As `atomic_path`.
    """
    texels = np.moveaxis(table.values, 0, -1)  # orders, columns, W
    scales: NDArray[Any] | None = None
    if path.suffix == ".ktx2":
        if texels.shape[2] not in (1, 2, 3, 4):
            raise ValueError(f"KTX2 holds one to four channels, found {texels.shape[2]} wavelengths")
        fmt = named(storage)
        if fmt.kind == "unorm":
            scales = texels.max(1)
            texels = texels / scales[:, None]
        codes = encode(texels, fmt, DEVICES["ideal"])
        kinds = {"unorm8": np.uint8, "unorm16": np.uint16, "float16": np.float16, "float32": np.float32}
        write_ktx2(path, codes.astype(kinds[storage]), fmt)
    elif path.suffix == ".npz":
        arrays: dict[str, NDArray[Any]] = {
            "values": table.values, "delta": table.delta, "forward": table.forward,
            "angles_deg": table.axes.angles_deg, "wavelengths_nm": np.array(table.axes.wavelengths_nm),
        }  # fmt: skip
        write_npz(path, arrays)
    elif path.suffix == ".raw":
        with atomic_path(path) as temporary:
            temporary.write_bytes(np.ascontiguousarray(texels, "<f4").tobytes())
    else:
        write(path, Image(_channels(texels, table), {"format": "float32"}))
    about = _about(table, name, storage, scales)
    raw = path.suffix == ".raw"
    if raw:  # the sidecar that readers of raw texels look for
        about |= {"width": texels.shape[1], "height": texels.shape[0], "channels": texels.shape[2], "type": "<f4"}
    with atomic_path(path.with_suffix(".json") if raw else path.with_name(path.name + ".json")) as temporary:
        temporary.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


def _channels(texels: NDArray[np.float32], table: Scattered) -> dict[str, NDArray[Any]]:
    waves = table.axes.wavelengths_nm
    names = ["R", "G", "B"] if len(waves) == 3 else ["Y"] if len(waves) == 1 else [f"{w:g}nm" for w in waves]
    return {name: np.ascontiguousarray(texels[..., i]) for i, name in enumerate(names)}


def _about(table: Scattered, name: str, storage: str, scales: NDArray[Any] | None) -> dict[str, Any]:
    axes = table.axes
    return {
        "particle": name, "wavelengths_nm": list(axes.wavelengths_nm), "columns": axes.columns, "orders": axes.orders,
        "rows": "Poisson numbers of mean 0, 1, ..., and one more" if axes.poisson else "n = 1, 2, ...",
        "column": "angle_deg / 180 * (columns - 1)", "unit": "1/sr", "storage": storage,
        "delta": table.delta.tolist(), "forward": table.forward.tolist(), "asymmetry": table.asymmetry.tolist(),
        **({} if scales is None else {"scales": scales.tolist()}),
    }  # fmt: skip

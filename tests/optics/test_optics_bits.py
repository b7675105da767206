"""What optics computes has the same bits at another lane width and on a processor without vector extensions."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import subprocess
import sys

import numpy as np

from atmoref.optics import legendre, mie, orders, refraction
from atmoref.optics.crystals import Crystals
from atmoref.optics.drops import cosines
from atmoref.optics.particles import DROPS
from atmoref.tables.scattered import Axes, build


def digests() -> str:
    """Return a hash of each thing that tables are made from."""
    mu = cosines(np.arange(361) / 2.0)
    sizes = np.geomspace(1e-3, 300.0, 40)
    traced = Crystals(2.5, 1.0, 20.0).trace_index(1.311, 100_000)
    few = Axes((550.0,), columns=361, orders=4)
    rain = build(dataclasses.replace(DROPS["rain"], fine_radii=3), few)
    cloud = build(dataclasses.replace(DROPS["cloud"], radii=20), dataclasses.replace(few, poisson=True))
    found = {
        "rain's table": np.concatenate([rain[name].astype(np.float64).ravel() for name in sorted(rain)]),
        "cloud's table": np.concatenate([cloud[name].astype(np.float64).ravel() for name in sorted(cloud)]),
        "efficiencies": np.array(mie.efficiencies(1.334 + 1e-8j, sizes)),
        "intensities": mie.intensities(1.334 + 1e-8j, sizes, sizes**-2, mu),
        "amplitudes": np.array(mie.amplitudes(1.5 + 0.1j, 77.0, mu)),
        "nodes": np.array(legendre.gauss_nodes(301)),
        "cloud": DROPS["cloud"].legendre(550.0, 20),
        "cumulus": DROPS["cumulus"].phase_function(mu, 440.0, 20),
        "rain": DROPS["rain"].phase_function(mu[::40], 680.0, 3),
        "orders": np.array([orders.mean_forward_share(DROPS["cloud"].legendre(550.0, 20), d) for d in (0.5, 7.0)]),
        "water": refraction.water(np.arange(380.0, 781.0)),
        "ice": np.array([refraction.ice(np.arange(380.0, 781.0)), refraction.ice_absorption(np.arange(380.0, 781.0))]),
        "crystals": traced.phase_function,
        "shares": np.array(traced[3:7]),
    }
    return "\n".join(
        f"{name} {hashlib.sha256(np.ascontiguousarray(v).tobytes()).hexdigest()}" for name, v in found.items()
    )


def test_lane_width_and_processor_leave_the_bits() -> None:
    tests = os.path.dirname(os.path.dirname(__file__))
    environment = os.environ | {"ATMOREF_LANES": "4", "NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}
    environment["NPY_DISABLE_CPU_FEATURES"] = "AVX512F AVX512CD AVX512_SKX AVX2 FMA3"
    environment["PYTHONPATH"] = os.pathsep.join([tests, os.path.dirname(tests)])
    code = "from optics.test_optics_bits import digests; print(digests())"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == digests().splitlines()

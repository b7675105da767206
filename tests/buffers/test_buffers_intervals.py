"""Stores, blends and reads of intervals against the lane functions: what any point gives lies between both ends."""

from __future__ import annotations

from typing import Any

import buffer_kernels as lanes
import buffer_operations as kernels
import numpy as np
import pytest

from atmoref.buffers.blend import Mixed
from atmoref.buffers.bounds import allocate_bounds
from atmoref.buffers.device import DEVICES, Device, rule
from atmoref.buffers.formats import FORMATS
from atmoref.buffers.interval_blend import rule_bounds
from atmoref.buffers.interval_sampler import texture_bounds
from atmoref.buffers.sampler import texture

SIZE = 4096
UNORM = ("unorm2", "unorm8", "unorm10", "unorm12", "unorm16")
ONCE = Device("once", quantise_first=False)  # blends in reals, rounded once


def _operands(name: str, seed: int, spread: float) -> tuple[np.ndarray, ...]:
    """Return stored, source and alpha, low and high ends."""
    rng = np.random.default_rng(seed)
    fmt = FORMATS[name]
    if fmt.kind == "unorm":
        low = rng.integers(0, fmt.top + 1, SIZE)
        high = np.minimum(low + rng.integers(0, 2 + int(spread * 4), SIZE), fmt.top)
    else:
        low = lanes.run(lanes.ENCODE, "float32", Mixed(), rule(fmt, DEVICES["ideal"]), np.zeros(SIZE), rng.random(SIZE))
        high = low
    ends: list[np.ndarray] = [low.astype(np.float32), high.astype(np.float32)]
    for _ in range(2):
        x = (rng.random(SIZE) * 1.1 - 0.02).astype(np.float32)
        ends += [x, (x + rng.random(SIZE) * spread).astype(np.float32)]
    return tuple(ends)


def _bounds(which: int, rules: Any, ends: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray]:
    data = tuple(end.copy() for end in ends[:2])
    out = (np.zeros(SIZE, np.float32), np.zeros(SIZE, np.float32))
    kernels.blend_kernel(kernels.EXACT, rules, data, out, ends[2:4], ends[4:6], which)
    return data  # type: ignore[return-value]


@pytest.mark.parametrize("spread", [0.0, 1e-6, 0.02])
@pytest.mark.parametrize("which", range(8))
@pytest.mark.parametrize("name", [*UNORM, "float16", "r11g11b10f", "float32"])
def test_every_blend_of_every_device_lies_between(name: str, which: int, spread: float) -> None:
    """Points within the operands, by the device's rule in `device`, by every other in the envelope of `ideal`."""
    fmt, ends = FORMATS[name], _operands(name, 3, spread)
    if which == 6 and fmt.kind == "unorm":  # the destination's alpha is a stored code
        ends = (*ends[:4], *ends[:2])
    rng = np.random.default_rng(4)
    devices = [*DEVICES.values(), ONCE]
    for device in devices:
        own = _bounds(which, rule_bounds(fmt, device, None, 0, envelope=False), ends)
        open_ = _bounds(which, rule_bounds(fmt, DEVICES["ideal"], None, 0, envelope=True), ends)
        for sample in range(6):
            part = rng.random((3, SIZE)) if sample else np.zeros((3, SIZE))
            d, s, a = (
                low + part[i] * (high - low) for i, (low, high) in enumerate(zip(ends[::2], ends[1::2], strict=True))
            )
            d = np.rint(d) if fmt.kind == "unorm" else d
            a = np.rint(a) if which == 6 and fmt.kind == "unorm" else a
            result = lanes.run(
                which, "float32", Mixed(), rule(fmt, device), d, s.astype(np.float32), a.astype(np.float32)
            )
            assert ((result >= own[0]) & (result <= own[1])).all(), device.name
            assert ((result >= open_[0]) & (result <= open_[1])).all(), device.name


@pytest.mark.parametrize("name", UNORM)
def test_points_are_decided_by_the_device_and_two_codes_by_the_envelope(name: str) -> None:
    ends = _operands(name, 5, 0.0)
    ends = (ends[0], ends[0], *ends[2:])
    low, high = _bounds(7, rule_bounds(FORMATS[name], DEVICES["ideal"], None, 0, envelope=False), ends)
    assert (low == high).mean() > 0.95
    assert (high - low).max() <= 1.0
    low, high = _bounds(7, rule_bounds(FORMATS[name], DEVICES["ideal"], None, 0, envelope=True), ends)
    assert (high - low).max() <= 2.0  # the product itself may round across a code
    codes = np.arange(SIZE, dtype=np.float32) % (FORMATS[name].top + 1) / np.float32(FORMATS[name].top)
    exact = (ends[0], ends[0], codes, codes, codes, codes)
    low, high = _bounds(0, rule_bounds(FORMATS[name], DEVICES["ideal"], None, 0, envelope=False), exact)
    np.testing.assert_array_equal(low, high)


FILTERS = ("exact", "fused", "bytes")


@pytest.mark.parametrize("width", [0.0, 1e-6, 0.01, 0.5])
@pytest.mark.parametrize("which", range(5))
@pytest.mark.parametrize("filtered", FILTERS)
def test_every_read_lies_between(filtered: Any, which: int, width: float) -> None:
    rng = np.random.default_rng(6)
    volume, compares = which == 3, which == 4
    shape = (5, 6, 7, 3) if volume else (9, 12) if compares else (9, 12, 3)
    fmt = FORMATS["unorm16" if compares else "unorm8"]
    chosen = "exact" if compares and filtered == "bytes" else filtered
    texels = rng.integers(0, fmt.top + 1, shape)
    texels[..., ::3] = texels[..., :1]  # flat places too
    filters = [f for f in FILTERS if not (compares and f == "bytes")]
    made = {f: texture(texels, fmt, DEVICES["ideal"], filter=f, volume=volume, compare="pcf") for f in filters}
    starts = rng.random((3, SIZE)).astype(np.float32)
    starts[:, :64] = rng.integers(0, 25, (3, 64)) / np.float32(24)  # texel centres and edges
    ends = [(x, np.minimum(x + np.float32(width), np.float32(1.0))) for x in starts]
    for envelope in (False, True):
        bounds = texture_bounds(made[chosen], made[chosen], eight_bits=fmt.name == "unorm8", envelope=envelope)
        out = (np.zeros(SIZE, np.float32), np.zeros(SIZE, np.float32))
        kernels.sample_kernel(kernels.EXACT, bounds, *ends, out, 1 if not compares else 0, which)
        for other in made if envelope else [chosen]:
            for _ in range(5):
                at = [(low + rng.random(SIZE) * (high - low)).astype(np.float32) for low, high in ends]
                value = lanes.sample(lanes.SAMPLERS[which], "float32", made[other], *at, channel=0 if compares else 1)
                value = value[1] if which == 2 else value
                assert ((value >= out[0]) & (value <= out[1])).all(), (envelope, other)


def test_bounds_of_buffers_go_in_and_out() -> None:
    buffer = allocate_bounds("frame", FORMATS["unorm8"], 5, 3, 3)
    low = np.arange(45, dtype=np.uint8).reshape(3, 5, 3)
    buffer.put(np.stack((low, low + 2)))
    np.testing.assert_array_equal(buffer.low.codes(), low)
    np.testing.assert_array_equal(buffer.high.codes(), low + 2)
    np.testing.assert_allclose(buffer.values() * 255.0, low + 1.0)
    buffer.put(low)
    np.testing.assert_array_equal(buffer.high.codes(), low)
    with pytest.raises(ValueError, match="low"):
        buffer.codes()
    buffer.clear()
    assert not buffer.values().any()
    assert buffer.nbytes == 2 * buffer.low.nbytes

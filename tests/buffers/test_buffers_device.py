"""Devices and the uniforms made of them."""

import dataclasses

import pytest

from atmoref.buffers.device import DEVICES, ROUNDINGS, Device, rule
from atmoref.buffers.formats import FORMATS


def test_presets_are_named_and_say_what_they_rest_on():
    assert list(DEVICES) == ["ideal", "gl_llvmpipe", "geforce3", "geforce_fx"]
    assert all(name == device.name for name, device in DEVICES.items())
    assert [d.name for d in DEVICES.values() if d.assumed] == ["geforce3", "geforce_fx"]
    assert [d.name for d in DEVICES.values() if d.measured] == ["gl_llvmpipe"]
    assert DEVICES["gl_llvmpipe"].measured <= set(FORMATS)


def test_every_rule_has_the_same_types_so_that_kernels_compile_once():
    kinds = {
        tuple(type(x) for x in rule(fmt, device, channel=channel))
        for fmt in FORMATS.values()
        for device in DEVICES.values()
        for channel in (0, 2)
    }
    assert len(kinds) == 1


@pytest.mark.parametrize("name", ["ideal", "geforce3", "geforce_fx"])
def test_rounding_overrides_where_it_is_open(name):
    for fmt in FORMATS.values():
        rules = {rule(fmt, DEVICES[name], rounding) for rounding in ROUNDINGS}
        assert len(rules) == 3
        own = DEVICES[name].rounding if fmt.kind == "unorm" else DEVICES[name].float_rounding
        assert rule(fmt, DEVICES[name]) == rule(fmt, DEVICES[name], own)


def test_rounding_of_a_measured_device_is_closed():
    with pytest.raises(ValueError, match="contradicts device 'gl_llvmpipe', whose rounding is measured"):
        rule(FORMATS["unorm8"], DEVICES["gl_llvmpipe"], "truncate")


def test_wrong_requests_name_what_is_allowed():
    with pytest.raises(ValueError, match="rounding is 'up', allowed: nearest_even, half_up, truncate"):
        rule(FORMATS["unorm8"], DEVICES["ideal"], "up")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="channel is 4"):
        rule(FORMATS["unorm8"], DEVICES["ideal"], channel=4)
    with pytest.raises(ValueError, match="float_rounding is 'up'"):
        Device("odd", float_rounding="up")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="16 bits"):
        dataclasses.replace(DEVICES["gl_llvmpipe"], quantise_first=False)

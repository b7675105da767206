# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""A three-channel render target: planes r, g, b of one flat array, each blended by the rule of its channel."""

from typing import Any, NamedTuple

from atmoref._jit import device
from atmoref.buffers.blend import Mixed, add, encode, read, write
from atmoref.lanes import compiled_only, is_tag, overload


class Colour(NamedTuple):
    """Three registers of one arithmetic."""

    r: Any
    g: Any
    b: Any


@compiled_only
def channel_rule(form: Any, rules: Any, channel: int) -> Any:
    """Return the rule of one channel: only r11g11b10f (class Mixed) has channels that differ."""


@overload(channel_rule)
def _channel_rule(form: Any, rules: Any, channel: int) -> Any:
    if is_tag(form, Mixed):
        return lambda form, rules, channel: rules[channel]
    return lambda form, rules, channel: rules[0]


@device
def read_colour(arith, data, at, size):
    """Return the stored colour of N texels; planes are `size` apart."""
    return Colour(read(arith, data, at), read(arith, data, at + size), read(arith, data, at + 2 * size))


@device
def write_colour(data, at, size, colour):
    """Return the opposite of `read_colour`."""
    write(data, at, colour.r)
    write(data, at + size, colour.g)
    write(data, at + 2 * size, colour.b)


@device
def add_colour(form, rules, stored, r, g, b):
    """Blend ONE, ONE, channel by channel."""
    return Colour(
        add(form, rules[0], stored.r, r),
        add(form, channel_rule(form, rules, 1), stored.g, g),
        add(form, channel_rule(form, rules, 2), stored.b, b),
    )


@device
def encode_colour(form, rules, r, g, b):
    """Return what a replaced texel stores."""
    return Colour(
        encode(form, rules[0], r),
        encode(form, channel_rule(form, rules, 1), g),
        encode(form, channel_rule(form, rules, 2), b),
    )

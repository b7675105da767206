"""The mutants: each is one mistake that engine people make, as a patch of a shader or of the host's calls.

`home` is the format in which the mistake shows as itself; `kinds` are the right names for it; `stage` ends the name of
the first draw that goes wrong.  Even ones were looked at while the diagnosis was written, odd ones were not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from atmoref.judge.diagnosis import (
    BLEND,
    FILTER,
    FLIP,
    FORMULA,
    GAMMA,
    HALF_TEXEL,
    ORDER,
    PLANES,
    ROUNDING,
    SHADOW,
    STORAGE,
)

Patch = tuple[str, str]
F_H, MAIN, OPAQUE, REFLECTED, SHADOW_MAP = (
    "-> f_h",
    "main -> frame",
    "opaque -> frame",
    "light_0/opaque -> frame",
    ("shadow_map -> light_0/shadow_map"),
)
DEPTH = "opaque -> depth"


@dataclass(frozen=True, slots=True)
class Mutant:
    """One mistake."""

    name: str
    stage: tuple[str, ...]
    kinds: tuple[str, ...]
    home: str = "float32"
    patches: tuple[Patch, ...] = ()
    apply: Callable[[Any], None] | None = None


def _blend(source: int, target: int, names: tuple[str, ...] = ("f_h", "frame")) -> Callable[[Any], None]:
    """Return a change of a build's blend factors for some targets."""

    def change(build: Any) -> None:
        aim = build.aim

        def aimed(where: Any, *, test: bool, blend: bool) -> None:
            aim(where, test=test, blend=blend)
            ours = (where is build.fast and "f_h" in names) or (where is build.frame and "frame" in names)
            build.ctx.blend_func = (source, target) if ours and test else (moderngl.ONE, moderngl.ONE)

        build.aim = aimed

    return change


def _depth(func: str) -> Callable[[Any], None]:
    def change(build: Any) -> None:
        aim = build.aim

        def aimed(where: Any, *, test: bool, blend: bool) -> None:
            aim(where, test=test, blend=blend)
            if test and blend and where is build.fast:
                build.ctx.depth_func = func

        build.aim = aimed

    return change


def _stored_as(target: str, fmt: str) -> Callable[[Any], None]:
    """Return a change that gives a target another format than its dump says: read back, it is converted."""

    def change(build: Any) -> None:
        from validation.gl.build import KINDS

        colour = build.ctx.texture(build.case.size, 4, dtype=KINDS[fmt][0])
        colour.filter = moderngl.NEAREST, moderngl.NEAREST
        made = build.ctx.framebuffer([colour], build.depth)
        setattr(build, target, made)
        read, name = build.read, {"frame": "frame", "fast": "f_h"}[target]

        def reading(asked: str) -> Any:
            if asked != name:
                return read(asked)
            width, height = build.case.size
            data = np.frombuffer(colour.read(alignment=1), KINDS[fmt][1]).reshape(height, width, 4)[..., :3]
            top = {"unorm8": 255.0, "unorm16": 65535.0}.get(fmt, 1.0)
            own = build.case.setting.formats[name]
            values = data.astype(np.float64) / top
            return np.rint(values * own.top).astype(own.storage) if own.kind == "unorm" else values.astype(own.storage)

        build.read = reading

    return change


def _texture(light_texture: str, change_it: Callable[[Any], None]) -> Callable[[Any], None]:
    def change(build: Any) -> None:
        for light in build.lights:
            change_it(light.shadow if light_texture == "shadow" else light.maps[light_texture])

    return change


def _nearest(texture: Any) -> None:
    texture.filter = moderngl.NEAREST, moderngl.NEAREST


def _reversed_compare(texture: Any) -> None:
    texture.compare_func = ">"


def _rolled(field: str, step: int) -> Callable[[Any], None]:
    def change(build: Any) -> None:
        for light in build.lights:
            light.draws = light.draws._replace(**{field: np.roll(getattr(light.draws, field), step)})

    return change


def _sub_planes(choose: Callable[[list[int]], list[int]], *, clear: bool = True) -> Callable[[Any], None]:
    """Return a change of which sub-planes of a slab are drawn, in which order."""

    def change(build: Any) -> None:
        from validation.gl.build import window_to_ndc

        def draw(light: Any, k: int) -> None:
            owner, draws = light.owner, light.draws
            program = light._program("sub_plane.frag")
            owner.aim(owner.fast, test=True, blend=True)
            if clear or k == 0:
                owner.fast.clear(0.0, 0.0, 0.0, 0.0)
            for s in choose(list(range(int(draws.first[k]), int(draws.first[k + 1])))):
                program["plane_depth"].value = window_to_ndc(draws.depth[s])
                program["plane_z"].value, program["share"].value = draws.z[s], draws.share[s]
                owner.cover(program)

        for light in build.lights:
            light.draw_sub_planes = lambda k, light=light: draw(light, k)

    return change


def _main_twice(build: Any) -> None:
    for light in build.lights:
        once = light.draw_main_plane
        light.draw_main_plane = lambda k, once=once: (once(k), once(k))


def _no_main(build: Any) -> None:
    for light in build.lights:
        once = light.draw_main_plane
        light.draw_main_plane = lambda k, once=once: once(k) if k != 2 else None


def _read_flipped(build: Any) -> None:
    read = build.read
    build.read = lambda name: np.ascontiguousarray(read(name)[::-1])


_HALF = "+ 0.5 / vec2(textureSize({0}, 0))"
_LIT = "textureLod(light_map, vec2(u, v)"
_MAIN_OUT = "colour = vec4(slow * fast, 0.0);"
_SUB_OUT = "colour = vec4(lit * share, 0.0);"
_SRGB = "mix(12.92 * x, 1.055 * pow(max(x, 0.0), 1.0 / 2.4) - 0.055, step(0.0031308, x))"


def _encoded(out: str, name: str) -> tuple[Patch, ...]:
    return (
        ("void main() {", f"float enc(float x) {{ return {_SRGB}; }}\nvoid main() {{"),
        (out, f"vec3 told = {name}; colour = vec4(enc(told.r), enc(told.g), enc(told.b), 0.0);"),
    )


MUTANTS: tuple[Mutant, ...] = (
    Mutant(
        "light map read half a texel off",
        (F_H, REFLECTED),
        (HALF_TEXEL,),
        "unorm8",
        ((_LIT, f"textureLod(light_map, vec2(u, v) {_HALF.format('light_map')}"),),
    ),
    Mutant(
        "shadow map read half a texel off",
        (F_H, REFLECTED),
        (HALF_TEXEL,),
        "float32",
        (("vec3(u, v, reference)", "vec3(vec2(u, v) " + _HALF.format("shadow_map") + ", reference)"),),
    ),
    Mutant(
        "q table read half a texel off",
        (MAIN,),
        (HALF_TEXEL,),
        "float32",
        (("textureLod(q_map, vec2(su, sv)", "textureLod(q_map, vec2(su, sv) " + _HALF.format("q_map")),),
    ),
    Mutant(
        "pixel centres at integers",
        (OPAQUE, DEPTH),
        (HALF_TEXEL,),
        "float32",
        (("Ray camera_ray(vec2 pixel) {", "Ray camera_ray(vec2 centre) {\n    vec2 pixel = centre - 0.5;"),),
    ),
    Mutant(
        "sub-planes without their share 1/m",
        (F_H,),
        (FORMULA,),
        "float32",
        ((_SUB_OUT, "colour = vec4(lit + min(share, 0.0), 0.0);"),),
    ),
    Mutant("wrong sign of alpha in q", (MAIN,), (FORMULA,), "unorm8", (("u = along + t;", "u = -(along + t);"),)),
    Mutant("dt without 1/cos psi (D-E6)", (MAIN,), (FORMULA,), "float32", (("c = c * ray.span;", "c = c;"),)),
    Mutant(
        "no extinction towards the eye",
        (MAIN,),
        (FORMULA,),
        "unorm8",
        (("mirror_exp(t * slab.sigma_r * -1.0)", "mirror_exp(t * slab.sigma_r * -0.0)"),),
    ),
    Mutant("blend factors ZERO, ONE", (MAIN,), (BLEND,), "unorm8", (), _blend(moderngl.ZERO, moderngl.ONE, ("frame",))),
    Mutant(
        "blend factors ONE, ZERO for sub-planes",
        (F_H,),
        (BLEND,),
        "unorm8",
        (),
        _blend(moderngl.ONE, moderngl.ZERO, ("f_h",)),
    ),
    Mutant(
        "blend factors ONE, ONE_MINUS_SRC_COLOR",
        (MAIN,),
        (BLEND,),
        "unorm8",
        (),
        _blend(moderngl.ONE, 0x0301, ("frame",)),
    ),
    Mutant(
        "blend factors SRC_ALPHA, ONE with alpha 0",
        (MAIN,),
        (BLEND,),
        "unorm16",
        (),
        _blend(moderngl.SRC_ALPHA, moderngl.ONE, ("frame",)),
    ),
    Mutant(
        "frame in RGBA8 where RGBA16F was asked",
        (OPAQUE, MAIN, REFLECTED),
        (STORAGE,),
        "float16",
        (),
        _stored_as("frame", "unorm8"),
    ),
    Mutant("f_h in RGBA8 where RGBA16 was asked", (F_H,), (STORAGE,), "unorm16", (), _stored_as("fast", "unorm8")),
    Mutant(
        "frame in RGBA16F where RGBA32F was asked",
        (OPAQUE, MAIN, REFLECTED),
        (STORAGE,),
        "float32",
        (),
        _stored_as("frame", "float16"),
    ),
    Mutant(
        "stores truncated in the main plane",
        (MAIN,),
        (ROUNDING,),
        "unorm8",
        ((_MAIN_OUT, "colour = vec4(floor(slow * fast * 255.0) / 255.0, 0.0);"),),
    ),
    Mutant(
        "stores truncated in the sub-planes",
        (F_H,),
        (ROUNDING,),
        "unorm8",
        ((_SUB_OUT, "colour = vec4(floor(lit * share * 255.0) / 255.0, 0.0);"),),
    ),
    Mutant(
        "light map read from the nearest texel",
        (F_H, REFLECTED),
        (FILTER,),
        "unorm8",
        (),
        _texture("light_map", _nearest),
    ),
    Mutant("q table read from the nearest texel", (MAIN,), (FILTER,), "unorm8", (), _texture("q_map", _nearest)),
    Mutant(
        "one shadow compare instead of four", (F_H, REFLECTED), (SHADOW,), "unorm8", (), _texture("shadow", _nearest)
    ),
    Mutant("no shadow bias", (F_H, REFLECTED), (SHADOW,), "float32", (("spot.bias * iw", "0.0 * iw"),)),
    Mutant(
        "no shadows",
        (F_H, REFLECTED),
        (SHADOW,),
        "unorm8",
        (("if (visible <= 0.0) {", "visible = 1.0;\n    if (visible <= 0.0) {"),),
    ),
    Mutant(
        "shadow compare the other way round",
        (F_H, REFLECTED),
        (SHADOW,),
        "unorm8",
        (),
        _texture("shadow", _reversed_compare),
    ),
    Mutant("light map squared", (F_H,), (FORMULA,), "float32", ((_SUB_OUT, "colour = vec4(lit * lit * share, 0.0);"),)),
    Mutant("main planes one slab further", (MAIN,), (PLANES, ORDER), "float32", (), _rolled("main_z", -1)),
    Mutant("last sub-plane of each slab missing", (F_H,), (PLANES,), "unorm8", (), _sub_planes(lambda s: s[:-1])),
    Mutant("every second sub-plane missing", (F_H,), (PLANES,), "unorm8", (), _sub_planes(lambda s: s[::2])),
    Mutant("sub-planes one place further", (F_H,), (PLANES,), "unorm8", (), _rolled("z", -1)),
    Mutant("f_h never cleared", (F_H,), (ORDER,), "unorm16", (), _sub_planes(lambda s: s, clear=False)),
    Mutant("main planes drawn twice", (MAIN,), (ORDER, FORMULA), "unorm8", (), _main_twice),
    Mutant("planes pass the depth test where they are hidden", (F_H,), (SHADOW,), "unorm8", (), _depth(">")),
    Mutant("no depth test for sub-planes", (F_H,), (SHADOW,), "unorm8", (), _depth("1")),
    Mutant("main planes encoded as sRGB", (MAIN,), (GAMMA,), "unorm8", _encoded(_MAIN_OUT, "slow * fast")),
    Mutant(
        "light map decoded from sRGB",
        (F_H, REFLECTED),
        (GAMMA,),
        "unorm8",
        (
            (
                "vec3 light_colour = vec3(textureLod(light_map, vec2(u, v), 0.0).r * visible)",
                "vec3 light_colour = vec3(pow(textureLod(light_map, vec2(u, v), 0.0).r, 2.2) * visible)",
            ),
        ),
    ),
    Mutant(
        "shadow map read upside down",
        (F_H, REFLECTED),
        (FLIP,),
        "unorm8",
        (("vec3(u, v, reference)", "vec3(u, 1.0 - v, reference)"),),
    ),
    Mutant("buffers read back upside down", (OPAQUE, DEPTH), (FLIP,), "unorm8", (), _read_flipped),
    Mutant(
        "q clamped, its second channel left out",
        (MAIN,),
        (FORMULA,),
        "float32",
        (("q = vec3(q.r + textureLod(q_rest", "q = vec3(q.r + 0.0 * textureLod(q_rest"),),
    ),
    Mutant("surfaces without 1/pi", (REFLECTED,), (FORMULA,), "float32", (("* 0.3183098861837907", "* 1.0"),)),
    Mutant(
        "surfaces without the inverse square",
        (REFLECTED,),
        (FORMULA,),
        "float32",
        (("facing / (distance_m * distance_m) * 0.31", "facing / distance_m * 0.31"),),
    ),
    Mutant("one main plane missing", (MAIN,), (PLANES, BLEND), "unorm8", (), _no_main),
    Mutant(
        "coordinates of the light map in half precision",
        (F_H, REFLECTED),
        (FILTER,),
        "float32",
        ((_LIT, "textureLod(light_map, unpackHalf2x16(packHalf2x16(vec2(u, v)))"),),
    ),
)

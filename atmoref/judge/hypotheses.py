"""Mistakes that the mirror makes on purpose: rules of devices, textures, uniforms, draws, readings of the paper."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.images import srgb_decode, srgb_encode
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
    Found,
    Guess,
)
from atmoref.judge.plan import Group, Plan, given, magnified, make_plan, retextured, with_device, with_inputs
from atmoref.scene import Scene, SceneError
from atmoref.scene.document import scene_from_mapping

MAGNIFIED = 8
MOST_LEFT_OUT = 16
Values = NDArray[np.float64]
Change = Callable[[Any], Any]

_DEVICES: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
    *((ROUNDING, f"unorm stores by the rule {r}", {"rounding": r}) for r in ("truncate", "half_up", "nearest_even")),
    *(
        (ROUNDING, f"float stores by the rule {r}", {"float_rounding": r})
        for r in ("truncate", "half_up", "nearest_even")
    ),
    (ROUNDING, "the blended sum is rounded once", {"quantise_first": False, "through_16_bits": frozenset()}),
    (ROUNDING, "products of codes are rounded once", {"product": "rounded"}),
    (ROUNDING, "codes are divided by their top, not multiplied", {"decode": "divided"}),
    *(
        (FILTER, f"textures of 8 bits are filtered by the rule {f}", {"bytes_filter": f})
        for f in ("exact", "fused", "bytes")
    ),
    *((FILTER, f"textures are filtered by the rule {f}", {"filter": f}) for f in ("exact", "fused")),
    (SHADOW, "the reference of the shadow compare is not clamped", {"clamp_shadow_reference": False}),
    (SHADOW, "the reference of the shadow compare is clamped", {"clamp_shadow_reference": True}),
)  # fmt: skip

_READINGS: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
    (FORMULA, "the scattering angle has the other sign (D-E3)", {"scattering_angle": "backward"}),
    (FORMULA, "the scattering angle has the other sign (D-E3)", {"scattering_angle": "forward"}),
    (FORMULA, "surfaces are seen through g(T) as printed (D-E1)", {"surface_fog": "printed"}),
    (FORMULA, "surfaces are seen through exp(-sigma_t T) (D-E1)", {"surface_fog": "transmittance"}),
    (FORMULA, "the ambient term saturates with distance (D-E34)", {"ambient": "saturating"}),
    (FORMULA, "the source lacks the albedo (D-E2)", {"albedo_in_source": False}),
    (FORMULA, "dt is the same for all pixels (D-E6)", {"dt_mode": "paper"}),
    (FORMULA, "dt is divided by cos psi (D-E6)", {"dt_mode": "cosine"}),
    (FORMULA, "f_h is the integral, dt times too large (D-E5)", {"f_h": "printed"}),
    (FORMULA, "q is clamped as published", {"q_storage": "clamped"}),
    (FORMULA, "the light map's distribution is computed per pixel", {"light_distribution": "exact"}),
    (FILTER, "q is integrated, not looked up", {"q": "exact"}),
    (PLANES, "sub-planes lie at j/(m-1), as printed (D-E10)", {"sub_plane_positions": "printed"}),
    (PLANES, "sub-planes lie at the left of their interval (D-E10)", {"sub_plane_positions": "left"}),
    (PLANES, "sub-planes lie in the middle of their interval (D-E10)", {"sub_plane_positions": "mid"}),
    (PLANES, "the main plane stands for its sub-planes", {"sub_plane_rule": "one"}),
    (ROUNDING, "shares of sub-planes are 1/m each (D-E12)", {"sub_plane_weights": "equal"}),
    (ROUNDING, "shares of sub-planes are telescoped (D-E12)", {"sub_plane_weights": "telescoped"}),
    (SHADOW, "sub-planes behind a surface are drawn (D-E33)", {"sub_plane_depth_test": False}),
    (SHADOW, "no shadow bias", {"shadow_bias_m": 0.0}),
    (SHADOW, "a shadow bias of 1 m", {"shadow_bias_m": 1.0}),
    (SHADOW, "one shadow compare instead of four", {"shadow_filter": "nearest"}),
    (SHADOW, "four shadow compares instead of one", {"shadow_filter": "pcf"}),
)  # fmt: skip


def guesses(scene: Scene, plan: Plan, found: Found) -> Iterator[Guess]:
    """Yield what the buffer would hold under every hypothesis that applies to the draws in question."""
    if not found.group:
        return
    yield from _draws(plan, found)
    yield from _uniforms(plan, found)
    yield from _textures(plan, found)
    for kind, sentence, fields in _DEVICES:
        if all(getattr(plan.setting.device, key) == value for key, value in fields.items()):
            continue
        with contextlib.suppress(ValueError, KeyError):
            other = make_plan(scene, plan.technique, with_device(**fields))
            yield Guess(kind, sentence, _redrawn(other, found))
    for kind, sentence, keys in _READINGS:
        with contextlib.suppress(ValueError, KeyError, SceneError):
            other = make_plan(_changed(scene, plan, keys), plan.technique)
            yield Guess(kind, sentence, _redrawn(other, found))


def _changed(scene: Scene, plan: Plan, keys: Mapping[str, Any]) -> Scene:
    """Return the scene with other parameters of its technique; raises KeyError where it has them, or lacks the key."""
    from atmoref.techniques.render import parameters

    now = parameters(scene, plan.technique)
    for key, value in keys.items():
        if getattr(now, key, value) == value:  # also where the technique lacks it
            raise KeyError(key)
    mapping = scene.to_mapping()
    mapping["technique"] = {**mapping["technique"], **keys}
    return scene_from_mapping(mapping, origin=scene.origin, name=scene.name, path=scene.path)


def _redrawn(plan: Plan, found: Found, group: Group | None = None, changes: Mapping[str, Any] | None = None) -> Values:
    """Return the buffer's values after the group is drawn from the build's previous buffers.

    Raises
    ------
    ValueError, KeyError
        The plan has other buffers or draws.
    """
    layers = {
        name: texels
        for name, texels in found.before.items()
        if name.rpartition("/")[2] in ("frame", "f_h", "depth", "shadow_map") and name in plan.bank
    }
    layers.update(changes or {})
    plan.put(layers)
    if found.buffer.rpartition("/")[2] != "shadow_map":
        plan.upload()
    chosen = found.group if group is None else group
    if any(at >= len(plan.passes) or last > len(plan.passes[at].draws) for at, _, last in chosen):
        raise KeyError(found.draw)
    plan.draw(chosen)
    if plan.bank[found.buffer].format.name != found.expected.name:
        raise ValueError(found.buffer)
    return found.values(plan.stored(found.buffer))


# ---- draws
def _draws(plan: Plan, found: Found) -> Iterator[Guess]:
    """Yield guesses that leave out draws, repeat them, or blend them otherwise."""
    before = found.previous()
    if before is None or not all(plan.passes[at].stores[d] == found.buffer for at, d, _ in found.group):
        return
    target = found.buffer.rpartition("/")[2]
    if target not in ("frame", "f_h") or found.draw == "opaque":
        return
    start = np.zeros_like(before) if target == "f_h" else before
    empty = {found.buffer: np.zeros_like(found.mirror)}
    drawn = [_redrawn(plan, found, (step,), empty) for step in found.group]
    yield Guess(BLEND, "the draw left the buffer as it was: a blend weight of 0, or nothing drawn", start)
    yield Guess(BLEND, "the source replaces what was there (ONE, ZERO)", drawn[-1])
    for told, rule in _BLENDS:
        held = start
        for source in drawn:
            held = np.clip(rule(held, source), 0.0, 1.0 if found.expected.kind == "unorm" else np.inf)
        yield Guess(BLEND, told, held)
    total = np.clip(start + sum(drawn), 0.0, 1.0 if found.expected.kind == "unorm" else np.inf)
    for at in range(len(drawn)) if 1 < len(drawn) <= MOST_LEFT_OUT else ():
        yield Guess(PLANES, f"draw {at} of the {len(drawn)} is missing", total - drawn[at])
        yield Guess(PLANES, f"draw {at} of the {len(drawn)} is drawn twice", total + drawn[at])
    if len(drawn) > 2:
        yield Guess(PLANES, "only the first sub-plane is drawn", start + drawn[0])
        yield Guess(PLANES, "every second sub-plane is missing", start + sum(drawn[::2]))
    if target == "f_h":
        kept = found.previous()
        assert kept is not None
        yield Guess(ORDER, "f_h is not cleared before the slab", np.clip(total + kept, 0.0, _top(found)))
    yield Guess(ORDER, "the draw is drawn twice", np.clip(total + sum(drawn), 0.0, _top(found)))
    yield from _neighbours(plan, found, start)


def _top(found: Found) -> float:
    return 1.0 if found.expected.kind == "unorm" else float("inf")


_BLENDS: tuple[tuple[str, Callable[[Values, Values], Values]], ...] = (
    ("the destination is weighted by 1 - source (screen)", lambda d, s: d * (1.0 - s) + s),
    ("the source is weighted by 1 - destination", lambda d, s: d + s * (1.0 - d)),
    ("source and destination are multiplied", lambda d, s: d * s),
    ("the source is weighted by the destination", lambda d, s: d + s * d),
    ("the source is subtracted", lambda d, s: d - s),
    ("the source is weighted by itself", lambda d, s: d + s * s),
    ("the greater of both is kept (MAX)", np.maximum),
    ("both are halved (CONSTANT_ALPHA)", lambda d, s: 0.5 * (d + s)),
)


def _neighbours(plan: Plan, found: Found, start: Values) -> Iterator[Guess]:
    """Yield guesses that draw a neighbour's plane instead: the draw of the slab before or after."""
    at, first, _ = found.group[-1]
    item = plan.passes[at]
    kind = item.draws[first].rpartition("/")[2].split("_")[0]
    same = [d for d, name in enumerate(item.draws) if name.rpartition("/")[2].split("_")[0] == kind]
    here = same.index(first)
    for step, told in ((-1, "before"), (1, "after")):
        if len(found.group) == 1 and 0 <= here + step < len(same):
            other = same[here + step]
            yield Guess(
                ORDER, f"the plane {told} it is drawn in its place", _redrawn(plan, found, ((at, other, other + 1),))
            )


# ---- uniforms
def _uniforms(plan: Plan, found: Found) -> Iterator[Guess]:
    """Yield guesses that change uniforms of the pass in question."""
    at = found.group[-1][0]
    item = plan.passes[at]
    held = given(item)
    if not {"uniforms", "blocks"} & held.keys() or found.buffer.endswith("shadow_map"):
        return
    yield from _depths(plan, found, at, held)
    for kind, sentence, change in _changes(plan, held):
        with contextlib.suppress(ValueError, KeyError, AttributeError):
            yield Guess(kind, sentence, _with(plan, found, at, _replaced(held, change)))


def _with(plan: Plan, found: Found, at: int, changes: Mapping[str, Any]) -> Values:
    """Return the buffer's values after a pass was drawn with other inputs; the pass is put back."""
    original = plan.passes[at]
    plan.passes[at] = with_inputs(original, changes)
    try:
        return _redrawn(plan, found)
    finally:
        plan.passes[at] = original


def _replaced(held: Mapping[str, Any], change: Change) -> dict[str, Any]:
    if "uniforms" in held:
        return {"uniforms": change(held["uniforms"])}
    return {"blocks": {key: change(value) for key, value in held["blocks"].items()}}


def _changes(plan: Plan, held: Mapping[str, Any]) -> Iterator[tuple[str, str, Change]]:
    """Yield changes of a pass's uniforms: where pixels and texels are, how far, how deep."""
    for dx, dy in ((1, 1), (-1, -1), (1, 0), (0, 1), (-1, 0), (0, -1)):
        yield HALF_TEXEL, f"pixel centres are off by {dx / 2}, {dy / 2}", _moved_camera(0.5 * dx, 0.5 * dy)
    uniforms = held.get("uniforms")
    q = next((b for n, b in plan.bank.items() if n.endswith("/q")), None)
    if uniforms is not None and hasattr(uniforms, "slab"):
        for dx, dy in ((1, 1), (-1, -1), (1, 0), (0, 1), (-1, 0), (0, -1)) if q is not None else ():
            size = q.width if q is not None else 1
            told = f"reads of the q table are off by {dx / 2}, {dy / 2} texels"
            yield HALF_TEXEL, told, _moved_table(0.5 * dx / size, 0.5 * dy / size)
        yield (
            FORMULA,
            "no extinction between the eye and the plane",
            _in("slab", lambda s: s._replace(sigma_r=0.0, sigma_g=0.0, sigma_b=0.0)),
        )
        yield FORMULA, "the q table's second channel is left out", _in("slab", lambda s: s._replace(rest=0.0))
        yield (
            FORMULA,
            "the scattering angle has the other sign (D-E3)",
            _in("slab", lambda s: s._replace(cosine=-s.cosine)),
        )
        yield FORMULA, "u of the q table has the other sign", _in("slab", lambda s: s._replace(scale_u=-s.scale_u))
    for factor in (0.0, 2.0, 10.0, 0.5, -1.0):
        yield (
            SHADOW,
            f"the shadow bias is {factor:g} times as large",
            _scaled_bias(factor),
        )


def _in(block: str, change: Change) -> Change:
    def whole(uniforms: Any) -> Any:
        return uniforms._replace(**{block: change(getattr(uniforms, block))})

    return whole


def _moved_table(du: float, dv: float) -> Change:
    return _in("slab", lambda s: s._replace(offset_u=s.offset_u + du, offset_v=s.offset_v + dv))


def _scaled_bias(factor: float) -> Change:
    return _in("spot", lambda s: s._replace(bias=s.bias * factor))


def _moved_camera(dx: float, dy: float) -> Change:
    return _in("camera", lambda c: c._replace(start_x=c.start_x + dx * c.step_x, start_y=c.start_y + dy * c.step_y))


def _moved_light(du: float, dv: float) -> Change:
    """Return a change that moves u and v of the light's maps: u w grows by du w; parallel light has no w."""

    def moved(uniforms: Any) -> Any:
        s = uniforms.spot
        if getattr(uniforms.switches, "parallel", 0):
            return uniforms._replace(spot=s._replace(u_0=s.u_0 + du, v_0=s.v_0 + dv))
        u = {f"u_{k}": getattr(s, f"u_{k}") + du * getattr(s, f"w_{k}") for k in "xyz0"}
        v = {f"v_{k}": getattr(s, f"v_{k}") + dv * getattr(s, f"w_{k}") for k in "xyz0"}
        return uniforms._replace(spot=s._replace(**u, **v))

    return moved


def _depths(plan: Plan, found: Found, at: int, held: Mapping[str, Any]) -> Iterator[Guess]:
    """Yield guesses about the depth of planes and their test against the scene's depth."""
    draws = held.get("draws")
    if draws is None:
        return
    fields = [name for name in ("z", "main_z") if hasattr(draws, name)]
    depths = [name for name in ("depth", "main_depth") if hasattr(draws, name)]
    for step, told in ((1, "before"), (-1, "after")):
        rolled = {name: np.roll(getattr(draws, name), step) for name in fields}
        yield Guess(PLANES, f"planes lie where the one {told} them should", _with(
            plan, found, at, {"draws": draws._replace(**rolled)}))  # fmt: skip
    open_test = draws._replace(**{name: np.zeros_like(getattr(draws, name)) for name in depths})
    whole = _with(plan, found, at, {"draws": open_test})
    yield Guess(SHADOW, "planes are drawn without a depth test", whole)
    before = found.previous()
    if before is not None:
        start = before if found.buffer.endswith("frame") else np.zeros_like(before)
        yield Guess(SHADOW, "the depth test is the other way round", whole - found.values(found.mirror) + start)


# ---- textures
def _textures(plan: Plan, found: Found) -> Iterator[Guess]:
    """Yield guesses that read other textures: nearest texels, upside down, in another transfer function, all lit."""
    if found.buffer.rpartition("/")[2] not in ("frame", "f_h") or not any(n.endswith("_map") for n in plan.bank):
        return
    at = found.group[-1][0]
    prefix = found.draw.partition("/")[0]
    for name in (f"{prefix}/light_map", f"{prefix}/shadow_map", f"{prefix}/q"):
        if name not in plan.bank:
            continue
        original, told = plan.bank[name], name.rpartition("/")[2]
        texels = found.before.get(name, original.codes())
        for kind, sentence, changed in _texture_changes(told, original, texels):
            with contextlib.suppress(ValueError, KeyError):
                yield Guess(kind, sentence, _reading(plan, found, at, name, changed))
    yield from _reversed_compare(plan, found, at, f"{prefix}/shadow_map")
    yield from _half_texels(plan, found, at, prefix)


def _half_texels(plan: Plan, found: Found, at: int, prefix: str) -> Iterator[Guess]:
    """Yield guesses that one of the light's two maps is read half a texel off; both are read at the same u, v.

    u and v move for both; the other map's texels move along with them, so that its reads stay where they were.
    """
    light, shadow = (plan.bank.get(f"{prefix}/{name}") for name in ("light_map", "shadow_map"))
    if light is None or shadow is None:
        return
    held = given(plan.passes[at])
    for moved, other in ((light, shadow), (shadow, light)):
        for dx, dy in ((1, 1), (-1, -1), (1, 0), (0, 1), (-1, 0), (0, -1)):
            du, dv = 0.5 * dx / moved.width, 0.5 * dy / moved.height
            texels = _shifted(found.before.get(other.name, other.codes()), du * other.width, -dv * other.height)
            inputs = _replaced(held, _moved_light(du, dv))
            told = f"{moved.name} is read {dx / 2}, {dy / 2} texels off"
            with contextlib.suppress(ValueError, KeyError, AttributeError):
                yield Guess(HALF_TEXEL, told, _reading(plan, found, at, other.name, retextured(other, texels), inputs))


def _shifted(texels: NDArray[Any], right: float, down: float) -> NDArray[Any]:
    """Return texels moved to the right and down by parts of a texel, linearly, edges repeated."""
    height, width, _ = texels.shape
    rows, columns = (np.clip(np.arange(n) - d, 0, n - 1) for n, d in ((height, down), (width, right)))
    values = texels.astype(np.float64)
    y0, x0 = (np.minimum(np.floor(a).astype(int), a.size - 2) for a in (rows, columns))
    wy, wx = (rows - y0)[:, None, None], (columns - x0)[None, :, None]
    values = values[y0] * (1 - wy) + values[y0 + 1] * wy
    values = values[:, x0] * (1 - wx) + values[:, x0 + 1] * wx
    moved: NDArray[Any] = (np.rint(values) if texels.dtype.kind == "u" else values).astype(texels.dtype)
    return moved


def _texture_changes(told: str, original: Any, texels: NDArray[Any]) -> Iterator[tuple[str, str, Any]]:
    same = retextured(original, texels)
    yield FLIP, f"{told} is read upside down", retextured(original, texels[::-1])
    yield FLIP, f"{told} is read mirrored", retextured(original, texels[:, ::-1])
    yield FLIP, f"{told} is read with u and v swapped", retextured(original, np.swapaxes(texels, 0, 1))
    if told == "shadow_map":
        top = original.format.top if original.format.kind == "unorm" else 1.0
        yield SHADOW, "no shadows: every compare is true", retextured(original, np.full_like(texels, top))
        yield SHADOW, "all in shadow: every compare is false", retextured(original, np.zeros_like(texels))
        return
    yield FILTER, f"{told} is read from the nearest texel", magnified(same, MAGNIFIED)
    if original.format.kind == "unorm":
        values = texels / original.format.top
        for sentence, function in (("sRGB-decoded", srgb_decode), ("sRGB-encoded", srgb_encode)):
            codes = np.rint(function(values) * original.format.top).astype(texels.dtype)
            yield GAMMA, f"{told} is {sentence} when it is read", retextured(original, codes)


def _reading(
    plan: Plan, found: Found, at: int, name: str, changed: Any, inputs: Mapping[str, Any] | None = None
) -> Values:
    """Return the buffer's values when another texture is read, with other inputs if given; all is put back."""
    original = plan.bank[name]
    if name.endswith("/q"):
        held = given(plan.passes[at])
        if "q" not in held:
            raise KeyError(name)
        return _with(
            plan, found, at, {"q": held["q"]._replace(**{held["q"]._fields[0]: plan.setting.texture(changed)})}
        )
    layers = {key: texels for key, texels in found.before.items() if key != name}
    plan.bank[name], original_pass = changed, plan.passes[at]
    plan.passes[at] = original_pass if inputs is None else with_inputs(original_pass, inputs)
    try:
        plan.put({k: v for k, v in layers.items() if k.rpartition("/")[2] in ("frame", "f_h", "depth", "shadow_map")})
        plan.upload()
        plan.draw(found.group)
        return found.values(plan.stored(found.buffer))
    finally:
        plan.bank[name], plan.passes[at] = original, original_pass


def _reversed_compare(plan: Plan, found: Found, at: int, name: str) -> Iterator[Guess]:
    """Yield the guess that lit and shadow are exchanged: all that would be lit, less what is."""
    if name not in plan.bank:
        return
    original = plan.bank[name]
    top = original.format.top if original.format.kind == "unorm" else 1.0
    whole = _reading(plan, found, at, name, retextured(original, np.full_like(original.codes(), top)))
    before = found.previous()
    if before is not None:
        start = np.zeros_like(before) if found.buffer.endswith("f_h") else before
        reversed_ = whole - found.values(found.mirror) + start
        yield Guess(SHADOW, "the shadow compare is the other way round", reversed_)

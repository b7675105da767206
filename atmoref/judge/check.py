"""A GPU build's dump judged draw by draw on the build's own previous buffers, then end to end.

The mirror draws what lies between two dumps, starting from what the build stored before; the build's next buffer is
compared with that, and then takes its place.  So an error is found where it is made, and nowhere after that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.judge.allowance import Allowed, BoundsOfDraw, DrawAsked, tolerance
from atmoref.judge.derived import DerivedBounds
from atmoref.judge.diagnosis import Explanation, Found, combined, diagnose
from atmoref.judge.dumps import DumpDirectory, DumpError, Entry, open_dump, read_entry
from atmoref.judge.plan import Group, Plan, Stored, make_plan
from atmoref.scene import Scene, SceneError

MOST_DIAGNOSED = 8
MOST_OF_A_KIND = 4
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Worst:
    """The element that lies furthest from the mirror's; pixel from the left and the top, codes or numbers."""

    x: int
    y: int
    channel: int
    build: float
    mirror: float
    allowed: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.allowed
        return (
            f"x {self.x}, y {self.y}, channel {self.channel}: {self.build:.7g} stored, {self.mirror:.7g} expected, "
            f"{low:.7g} to {high:.7g} allowed"
        )


@dataclass(frozen=True, slots=True)
class DrawVerdict:
    """How one dumped buffer was judged.

    Parameters
    ----------
    draw, buffer, format : str
        As the manifest names them.
    drawn : int
        Draws since the dump before: one, unless the build left some out.
    allowed : str
        What was applied.
    pixels, outside, off : int
        Judged pixels, those outside the bounds, and those that differ from the mirror at all.
    passed : bool
    worst : Worst or None
        None where nothing differs.
    explanations : tuple of Explanation
        Best first; empty for a draw that passed, and after the first few that did not.
    envelope : bool or None
        Whether it lies within what any device may store that the specifications permit; None where no interval is
        derived.
    """

    draw: str
    buffer: str
    format: str
    drawn: int
    allowed: str
    pixels: int
    outside: int
    off: int
    passed: bool
    worst: Worst | None
    explanations: tuple[Explanation, ...] = ()
    envelope: bool | None = None

    @property
    def name(self) -> str:
        """What a verdict calls it."""
        return f"{self.draw or 'texture'} -> {self.buffer}"

    @property
    def diagnosis(self) -> str:
        """The class of its best explanation, or an empty text."""
        return self.explanations[0].kind if self.explanations else ""


@dataclass(frozen=True, slots=True)
class EndToEnd:
    """The build's last frame beside the mirror's own, each on its own buffers throughout: reported, not judged."""

    draw: str
    pixels: int
    off: int
    worst: Worst | None


@dataclass(frozen=True, slots=True)
class CheckVerdict:
    """What `check` found."""

    directory: str
    scene: str
    technique: str
    device: str
    draws: tuple[DrawVerdict, ...]
    end_to_end: EndToEnd | None
    notes: tuple[str, ...] = ()
    pictures: dict[str, tuple[NDArray[Any], ...]] = field(default_factory=dict, compare=False, repr=False)

    @property
    def passed(self) -> bool:
        """Whether every dumped draw lies within its bounds."""
        return all(draw.passed for draw in self.draws)

    @property
    def envelope(self) -> bool | None:
        """Whether every draw lies within `envelope`; None where no interval is derived."""
        asked = [draw.envelope for draw in self.draws if draw.envelope is not None]
        return all(asked) if asked else None

    @property
    def first(self) -> DrawVerdict | None:
        """The first draw that left its bounds."""
        return next((draw for draw in self.draws if not draw.passed), None)

    @property
    def cause(self) -> Explanation | None:
        """The class and sentence that explain the failing draws that were looked into; None where all passed."""
        return combined([draw.explanations for draw in self.draws if draw.explanations])


def check(
    directory: str | Path,
    scene: Scene,
    *,
    technique: str | None = None,
    bounds_of_draw: BoundsOfDraw | None = None,
    mask: NDArray[np.bool_] | None = None,
    diagnosed: bool = True,
    progress: Progress | None = None,
) -> CheckVerdict:
    """Return the verdict on a directory of draw dumps.

    Parameters
    ----------
    directory : path
        As `dumps.open_dump` reads it.
    scene : Scene
        The question, with the formats and the device of the build.
    technique : str or None
        Instead of the scene's own.
    bounds_of_draw : callable or None
        What a draw may store; None: intervals derived for the scene's device, or, where there are none (a note says
        so), `allowance.tolerance`.
    mask : (H, W) array of bool or None
        Judged pixels of buffers of the picture's size, row 0 at the top.
    diagnosed : bool
        Look for the cause of the first draws that fail.
    progress : callable (draw name, fraction done) or None

    Raises
    ------
    DumpError
        The dump cannot be judged.
    SceneError
        The scene is wrong.
    """
    dump = open_dump(Path(directory))
    plan = make_plan(scene, technique)
    _check_names(dump, plan)
    notes = [f"build: {dump.told[key]}" for key in ("about",) if str(dump.told.get(key, ""))]
    if bounds_of_draw is None:
        bounds_of_draw, told = _bounds(scene, plan.technique)
        notes += told
    walk = _Walk(scene, plan, dump, bounds_of_draw, mask, MOST_DIAGNOSED if diagnosed else 0)
    verdicts = list(walk.verdicts(progress))
    if not verdicts:
        raise DumpError(f"{dump.path}: no buffer of the mirror is in this dump")
    return CheckVerdict(
        str(dump.path), scene.name, plan.technique, plan.setting.device.name, tuple(verdicts),
        _end_to_end(dump, scene, technique, mask), tuple(notes), walk.pictures,
    )  # fmt: skip


def _bounds(scene: Scene, technique: str) -> tuple[BoundsOfDraw, list[str]]:
    """Return the derived intervals of a scene's device, or a tolerance and a note that says why."""
    try:
        return DerivedBounds(scene, technique), []
    except SceneError as error:
        return tolerance, [f"bounds are a tolerance, for intervals do not answer this scene: {error}"]


def _check_names(dump: DumpDirectory, plan: Plan) -> None:
    """Refuse draws and buffers that the mirror does not have: a wrong scene, or wrong parameters."""
    stores = {(name, p.stores[i]) for p in plan.passes for i, name in enumerate(p.draws)}
    draws = {name for name, _ in stores}
    for entry in dump.entries:
        if entry.draw and entry.draw not in draws:
            some = ", ".join(sorted(draws)[:4])
            raise DumpError(
                f"{dump.path}: the scene has no draw named {entry.draw[:80]!r}; there are, for example, {some}; "
                "is it the scene that the build drew?"
            )
        if entry.buffer not in plan.bank:
            raise DumpError(
                f"{dump.path}: {entry.draw[:80]}: no buffer named {entry.buffer[:80]!r}; "
                f"allowed: {', '.join(sorted(plan.bank))}"
            )


class _Walk:
    """One pass over the draws, with the build's buffers in the mirror's bank."""

    def __init__(
        self, scene: Scene, plan: Plan, dump: DumpDirectory, bounds_of_draw: BoundsOfDraw,
        mask: NDArray[np.bool_] | None, diagnose: int,
    ) -> None:  # fmt: skip
        self.scene, self.plan, self.dump, self.bounds, self.mask = scene, plan, dump, bounds_of_draw, mask
        self.left = diagnose
        self.envelope: DerivedBounds | None = None
        self.looked_into: dict[str, list[float]] = {}
        self.failed: dict[str, int] = {}
        self.tied: set[str] = set()  # kinds of draws whose cause is not clear yet
        self.pictures: dict[str, tuple[NDArray[Any], ...]] = {}
        self.by_draw: dict[str, list[Entry]] = {}
        for entry in dump.entries:
            self.by_draw.setdefault(entry.draw, []).append(entry)

    def verdicts(self, progress: Progress | None) -> Iterator[DrawVerdict]:
        """Yield the verdicts in GPU order."""
        for entry in self.by_draw.get("", ()):
            yield self._texture(entry)
        group: list[tuple[int, int, int]] = []
        before = self._snapshot()
        total = sum(len(p.draws) for p in self.plan.passes)
        done = 0
        for at, item in enumerate(self.plan.passes):
            for d, name in enumerate(item.draws):
                step = (at, d, d + 1)
                self.plan.draw((step,))
                group.append(step)
                done += 1
                if progress is not None:
                    progress(name, done / total)
                if name in self.by_draw and not name.endswith("/upload"):
                    yield from self._judged(name, tuple(group), before)
                    group, before = [], self._snapshot()

    def _snapshot(self) -> Stored:
        """Return every buffer's texels; texture tables, which no draw changes, are the plan's own."""
        return {name: self.plan.stored(name) for name in self.plan.bank}

    def _judged(self, name: str, group: Group, before: Stored) -> Iterator[DrawVerdict]:
        """Judge all buffers that were dumped after one draw, then let them take the mirror's place."""
        stored: Stored = {}
        for entry in self.by_draw[name]:
            mirror = self.plan.stored(entry.buffer)
            build = read_entry(entry, (*mirror.shape[:2], mirror.shape[2]))
            verdict, found = self._verdict(entry, build, mirror, group, before)
            if not verdict.passed and self._worth_it(entry, verdict):
                top = found.expected.top if found.expected.kind == "unorm" else None
                shown = build if found.format is found.expected else _rescaled(build, entry, top)
                self.pictures[verdict.name] = (shown, mirror, found.low, found.high)
                explanations = diagnose(self.scene, self.plan, found)
                kind = entry.buffer + "/" + name.rpartition("/")[2].split("_")[0]
                self.tied.discard(kind)
                if len(explanations) > 1 and explanations[1].left < explanations[0].left + 0.05:
                    self.tied.add(kind)
                verdict = replace(verdict, explanations=explanations)
            stored[entry.buffer] = _in_format(build, entry, self.plan)
            yield verdict
        self.plan.put(stored)

    def _worth_it(self, entry: Entry, verdict: DrawVerdict) -> bool:
        """Decide whether to look into a draw: the first of its kind; more while causes tie or it is twice as wrong."""
        kind = entry.buffer + "/" + entry.draw.rpartition("/")[2].split("_")[0]
        wrong = float("inf") if verdict.worst is None else abs(verdict.worst.build - verdict.worst.mirror)
        earlier = self.looked_into.setdefault(kind, [])
        self.failed[kind] = count = self.failed.get(kind, 0) + 1
        further = kind in self.tied and count & (count - 1) == 0  # the 2nd, 4th, 8th: neighbours say the same
        clear = not further and (not earlier or wrong < 2.0 * earlier[-1])
        if self.left <= 0 or len(earlier) >= MOST_OF_A_KIND or (earlier and clear):
            return False
        self.left -= 1
        earlier.append(wrong)
        return True

    def _texture(self, entry: Entry) -> DrawVerdict:
        """Judge a texture that the host made before the first draw."""
        mirror = self.plan.stored(entry.buffer)
        build = read_entry(entry, (*mirror.shape[:2], mirror.shape[2]))
        verdict, found = self._verdict(entry, build, mirror, (), {})
        if not verdict.passed and self.left > 0:
            self.left -= 1
            verdict = replace(verdict, explanations=diagnose(self.scene, self.plan, found))
        if entry.buffer.endswith("light_map"):
            self.plan.put({entry.buffer: _in_format(build, entry, self.plan)})
        return verdict

    def _verdict(
        self, entry: Entry, build: NDArray[Any], mirror: NDArray[Any], group: Group, before: Stored
    ) -> tuple[DrawVerdict, Found]:
        expected = self.plan.bank[entry.buffer].format
        draws = tuple((self.plan.passes[at], first, last) for at, first, last in group)
        asked = DrawAsked(entry.draw, entry.buffer, draws, before, self.plan.bank, mirror, expected)
        judged = self._mask(mirror.shape)
        other = entry.format.name != expected.name
        test = _rescaled(build, entry, expected.top if expected.kind == "unorm" else None) if other else build
        if isinstance(self.bounds, DerivedBounds) and np.array_equal(test, mirror):
            allowed = self.bounds.around(mirror)  # the mirror lies within: no need to draw it in intervals
        else:
            allowed = self.bounds(asked)
        verdict = judge_texels(entry, test, mirror, allowed, judged, len(group), wrong_format=other)
        if isinstance(self.bounds, DerivedBounds) and group:
            within = verdict.passed or self._in_envelope(entry, test, judged, asked, wrong_format=other)
            verdict = replace(verdict, envelope=within)
        return verdict, Found(
            entry.draw, entry.buffer, entry.format, expected, group, before, build, mirror, judged, allowed.lo,
            allowed.hi,
        )  # fmt: skip

    def _in_envelope(
        self, entry: Entry, test: NDArray[Any], judged: NDArray[np.bool_], asked: DrawAsked, *, wrong_format: bool
    ) -> bool:
        """Ask the envelope about a draw that left the device's interval (which lies within it)."""
        if self.envelope is None:
            self.envelope = DerivedBounds(self.scene, self.plan.technique, "envelope")
        wide = self.envelope(asked)
        return judge_texels(entry, test, asked.stored, wide, judged, 0, wrong_format=wrong_format).passed

    def _mask(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        if self.mask is None or self.mask.shape != shape[:2]:
            return np.ones(shape[:2], np.bool_)
        return self.mask


def judge_texels(
    entry: Entry, build: NDArray[Any], mirror: NDArray[Any], allowed: Allowed, judged: NDArray[np.bool_], drawn: int,
    *, wrong_format: bool = False,
) -> DrawVerdict:  # fmt: skip
    """Return the verdict on one buffer (H, W, C)."""
    test, expected = build.astype(np.float64), mirror.astype(np.float64)
    excess = np.maximum(allowed.lo - test, test - allowed.hi).max(-1)
    difference = np.where(judged[..., None], np.abs(test - expected), 0.0)
    off = int((difference.max(-1) > 0.0).sum())
    outside = int(((excess > 0.0) & judged).sum())
    pixels = int(judged.sum())
    passed = outside == 0 and off <= allowed.few * pixels and not wrong_format
    worst = None
    if off:
        y, x, c = (int(i) for i in np.unravel_index(int(difference.argmax()), difference.shape))
        reach = (float(allowed.lo[y, x, c]), float(allowed.hi[y, x, c]))
        worst = Worst(x, y, c, float(test[y, x, c]), float(expected[y, x, c]), reach)
    return DrawVerdict(
        entry.draw, entry.buffer, entry.format.name, drawn, allowed.name, pixels, outside, off, passed, worst
    )


def _rescaled(build: NDArray[Any], entry: Entry, top: int | None) -> NDArray[Any]:
    """Return what a build stored in another format, in the units of the expected one."""
    values = build.astype(np.float64) / (entry.format.top if entry.format.kind == "unorm" else 1.0)
    return values if top is None else values * top


def _in_format(build: NDArray[Any], entry: Entry, plan: Plan) -> NDArray[Any]:
    """Return the build's texels as the mirror's buffer takes them."""
    expected = plan.bank[entry.buffer].format
    if entry.format.name == expected.name:
        return build
    return _rescaled(build, entry, None)


def _end_to_end(
    dump: DumpDirectory, scene: Scene, technique: str | None, mask: NDArray[np.bool_] | None
) -> EndToEnd | None:
    """Return the comparison of the last dumped frame with the mirror's own, or None where that draw has none."""
    plan = make_plan(scene, technique)
    last: Entry | None = None
    for item in plan.passes:
        for name in item.draws:
            last = dump.find(name, "frame") or last
    if last is None:
        return None
    for at, item in enumerate(plan.passes):
        stop = item.draws.index(last.draw) + 1 if last.draw in item.draws else len(item.draws)
        plan.draw(((at, 0, stop),))
        if last.draw in item.draws:
            break
    mirror = plan.stored("frame")
    build = read_entry(last, (*mirror.shape[:2], mirror.shape[2]))
    fmt = plan.bank["frame"].format
    if last.format.name != fmt.name:
        build = _rescaled(build, last, fmt.top if fmt.kind == "unorm" else None)
    judged = np.ones(mirror.shape[:2], np.bool_) if mask is None else mask
    same = mirror.astype(np.float64)
    found = judge_texels(last, build, mirror, Allowed(same, same), judged, 0)
    return EndToEnd(last.draw, found.pixels, found.off, found.worst)

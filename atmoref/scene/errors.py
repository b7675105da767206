"""Turn what is wrong with a scene file, or with a technique's parameters, into one clear message."""

from __future__ import annotations

import difflib
import types
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from atmoref.scene.describe import allowed, allowed_kind, choice, found, key_names, shorten, tags

M = TypeVar("M", bound=BaseModel)
Part = str | int
_MAX_PROBLEMS = 20
_ABSENT = object()


class SceneError(ValueError):
    """The scene, or what was asked of it, is wrong; the message names file, key path, what was found and is allowed."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong.

    Parameters
    ----------
    path
        Where: keys and list indices from the top of the file (or from the validated model).
    text
        What was found and what is allowed.
    """

    path: tuple[Part, ...]
    text: str

    def line(self, prefix: str = "") -> str:
        """Return ``key.path[0]: text``."""
        place = join_path(self.path, prefix)
        return f"{place}: {self.text}" if place else self.text


class Contradiction(ValueError):
    """Raised by model validators: keys that are each fine but not together.

    Parameters
    ----------
    *problems
        Their paths are relative to the model whose validator raises.
    """

    def __init__(self, *problems: Problem) -> None:
        super().__init__("; ".join(problem.line() for problem in problems))
        self.problems = problems


def contradiction(path: Iterable[Part], found_text: str, allowed_text: str) -> Contradiction:
    """Return a ``Contradiction`` at one path, in the usual words."""
    return Contradiction(Problem(tuple(path), f"found {found_text}; allowed: {allowed_text}"))


def join_path(path: Iterable[Part], prefix: str = "") -> str:
    """Return ``prefix.key[0].key``."""
    text = prefix
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else (f".{part}" if text else part)
    return text


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ' (did you mean X?)' for the nearest known word, or nothing."""
    candidates = list(known)
    near = difflib.get_close_matches(word.lower(), candidates, n=1, cutoff=0.6)
    if not near:  # fov for vertical_fov_deg
        parts = set(word.lower().split("_"))
        near = sorted((name for name in candidates if parts & set(name.split("_"))), key=len)
    return f" (did you mean {near[0]}?)" if near else ""


def scene_error(origin: str, lines: Sequence[str]) -> SceneError:
    """Return the error for one file: one line, or a count and a line for each problem."""
    if len(lines) == 1:
        return SceneError(f"{origin}: {lines[0]}")
    shown = [f"  {line}" for line in lines[:_MAX_PROBLEMS]]
    if len(lines) > _MAX_PROBLEMS:
        shown.append(f"  … and {len(lines) - _MAX_PROBLEMS} more")
    return SceneError("\n".join([f"{origin}: {len(lines)} problems", *shown]))


def parse_model(
    model: type[M], mapping: Mapping[str, Any], origin: str, key_path: str = "", known: Sequence[str] = ()
) -> M:
    """Return the validated model of a mapping.

    Parameters
    ----------
    model
        A pydantic model; a ``Contradiction`` raised by its validators keeps its own paths.
    mapping
        Plain values, as TOML gives them.
    origin
        File name, as the message should show it.
    key_path
        Where the mapping stands in the file, e.g. ``technique``.
    known
        More keys that are allowed at the top of the mapping but are read by someone else.

    Raises
    ------
    SceneError
        Naming file, key path, what was found, what is allowed, and the nearest known key.
    """
    try:
        return model.model_validate(mapping)
    except ValidationError as error:
        problems = _problems(error, model, mapping, known)
        raise scene_error(origin, [problem.line(key_path) for problem in problems]) from None


def _problems(
    error: ValidationError, model: type[BaseModel], raw: Mapping[str, Any], known: Sequence[str]
) -> list[Problem]:
    """Return one problem per place, in the order of the models.

    Left out: what follows from a wrong type (its keys are unknown), and a table's or list's own complaint (too few
    items) when something below it is wrong.
    """
    collected: dict[tuple[Part, ...], list[Problem]] = {}
    wrong_types: set[tuple[Part, ...]] = set()
    for detail in error.errors(include_url=False):
        place = _Place.find(model, raw, detail["loc"])
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, Contradiction):
            for problem in cause.problems:
                path = place.path + problem.path
                collected.setdefault(path, []).append(Problem(path, problem.text))
            continue
        problem = _problem(place, detail["type"], detail["msg"], known)
        collected.setdefault(problem.path, [problem])
        if problem.path and problem.path[-1] == "type":
            wrong_types.add(problem.path[:-1])
    above = {path[:end] for path in collected for end in range(len(path))}
    return [
        problem
        for path, problems in collected.items()
        if path not in above
        if path[-1:] == ("type",) or not any(path[:end] in wrong_types for end in range(len(path)))
        for problem in problems
    ]


def _problem(place: _Place, kind: str, message: str, known: Sequence[str]) -> Problem:
    stray = kind in ("model_type", "model_attributes_type") and place.field is None  # no table, where one may be named
    if place.owner is not None and place.path and (kind == "extra_forbidden" or stray):
        keys = [*key_names(place.owner), *(known if len(place.path) == 1 else ())]
        here = ["allowed here: " + ", ".join(keys) if keys else "no keys are allowed here"]
        here += [f"or {allowed_kind(place.annotation)} of any other name"] if stray else []
        hint = nearest(str(place.path[-1]), keys)
        return Problem(place.path, f"unknown key{hint}; found {found(place.value)}; {', '.join(here)}")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        value = place.value.get("type", _ABSENT) if isinstance(place.value, Mapping) else _ABSENT
        names = tags(place.members, "type")
        hint = nearest(value, names) if isinstance(value, str) else ""
        text = "missing; needed" if value is _ABSENT else f"found {found(value)}; allowed"
        return Problem((*place.path, "type"), f"{text}: {choice(names)}{hint}")
    permitted = allowed(place.field) if place.field is not None else message
    if kind in ("value_error", "assertion_error"):
        permitted = message.split(", ", 1)[-1]
    if place.value is _ABSENT:
        return Problem(place.path, f"missing; needed: {permitted}")
    hint = ""
    if kind == "literal_error" and place.field is not None and isinstance(place.value, str):
        hint = nearest(place.value, _literals(place.field.annotation))
    return Problem(place.path, f"found {found(place.value)}; allowed: {permitted}{hint}")


def _literals(annotation: Any) -> list[str]:
    if get_origin(annotation) is Literal:
        return [str(value) for value in get_args(annotation)]
    return [word for argument in get_args(annotation) for word in _literals(argument)]


@dataclass(frozen=True, slots=True)
class _Place:
    """Where an error lies, walked at once through the models and through the raw values."""

    path: tuple[Part, ...]
    value: Any
    field: FieldInfo | None
    owner: type[BaseModel] | None
    annotation: Any
    members: tuple[type[BaseModel], ...]

    @staticmethod
    def find(model: type[BaseModel], raw: Any, location: Sequence[Part]) -> _Place:
        """Return the place of a pydantic ``loc``; parts that name union members are left out of the path."""
        path: list[Part] = []
        annotation: Any = model
        field: FieldInfo | None = None
        owner: type[BaseModel] | None = None
        for part in location:
            annotation, members = _bare(annotation)
            if isinstance(part, int):
                if not isinstance(raw, list | tuple) or part >= len(raw) or _is_vector(annotation):
                    break  # one number stood for three, or the list is a short one, better shown whole
                raw = raw[part]
                annotation = _item(annotation)
            elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
                owner = annotation
                field, annotation = _member(annotation, part)
                raw = raw.get(part, _ABSENT) if isinstance(raw, Mapping) else _ABSENT
            elif members:
                annotation = next((member for member in members if part in _tags_of(member)), annotation)
                continue
            elif get_origin(annotation) is dict:
                annotation = get_args(annotation)[1]
                raw = raw.get(part, _ABSENT) if isinstance(raw, Mapping) else _ABSENT
            else:
                continue
            path.append(part)
        return _Place(tuple(path), raw, field, owner, *_bare(annotation))


def _bare(annotation: Any) -> tuple[Any, tuple[type[BaseModel], ...]]:
    """Return an annotation without wrappers and None, and the models of a union."""
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    if get_origin(annotation) in (Union, types.UnionType):
        members = [_bare(member)[0] for member in get_args(annotation) if member is not type(None)]
        if len(members) == 1:
            return members[0], ()
        return annotation, tuple(m for m in members if isinstance(m, type) and issubclass(m, BaseModel))
    return annotation, ()


def _is_vector(annotation: Any) -> bool:
    return get_origin(annotation) is tuple and Ellipsis not in get_args(annotation)


def _item(annotation: Any) -> Any:
    if get_origin(annotation) in (Union, types.UnionType):
        lists = [member for member in get_args(annotation) if get_origin(member) in (list, tuple)]
        annotation = lists[0] if lists else None
    arguments = get_args(annotation)
    return arguments[0] if arguments else None


def _member(model: type[BaseModel], key: str) -> tuple[FieldInfo | None, Any]:
    for name, field in model.model_fields.items():
        if key in (name, field.alias):
            return field, field.annotation
    extra = get_type_hints(model, include_extras=True).get("__pydantic_extra__")
    values = get_args(extra)
    return None, values[1] if len(values) == 2 else None


def _tags_of(member: type[BaseModel]) -> tuple[Any, ...]:
    field = member.model_fields.get("type")
    return get_args(field.annotation) if field is not None else ()


__all__ = [
    "Contradiction",
    "Problem",
    "SceneError",
    "contradiction",
    "join_path",
    "nearest",
    "parse_model",
    "scene_error",
    "shorten",
]

"""The commands put together, and what happens around each of them: signals, messages, exit codes."""

from __future__ import annotations

import contextlib
import functools
import logging
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any

import typer
from typer.main import get_command

from atmoref.cli import (
    benching,
    bounding,
    checking,
    comparing,
    doctoring,
    exporting,
    judging,
    looking,
    rendering,
    scattering,
    storing,
    tracing,
)
from atmoref.cli.failures import WRONG_REQUEST, RequestError, verdict_of
from atmoref.cli.signals import Signalled

LANE_WIDTHS = ("1", "2", "4", "8", "16", "32")
_USAGE_ERROR = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
_COMMANDS: tuple[tuple[str, Callable[..., None]], ...] = (
    ("render", rendering.render),
    ("trace", tracing.trace),
    ("compare", comparing.compare),
    ("check", checking.check),
    ("accept", checking.accept),
    ("export", exporting.export),
    ("bounds", bounding.bounds),
    ("budget", judging.budget),
    ("chart", judging.chart),
    ("bench", benching.bench),
    ("demo", judging.demo),
    ("scenes", looking.scenes),
    ("techniques", looking.techniques),
    ("schema", looking.schema),
    ("validate", looking.validate),
    ("info", looking.info),
    ("doctor", doctoring.doctor),
)
_TABLE_COMMANDS: tuple[tuple[str, Callable[..., None]], ...] = (
    ("build", storing.build),
    ("list", storing.list_),
    ("verify", storing.verify),
    ("export", storing.export),
    ("clear", storing.clear),
)

_OPTICS_COMMANDS: tuple[tuple[str, Callable[..., None]], ...] = (
    ("plot", scattering.plot),
    ("table", scattering.table),
)


def _flushed(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that notices within itself that nobody reads its output any more."""

    @functools.wraps(command)
    def run_and_flush(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
            sys.stdout.flush()
        except BrokenPipeError:
            raise Signalled(signal.SIGPIPE) from None

    return run_and_flush


def _version(asked: bool) -> None:
    """Print the version and stop, whatever else is there."""
    if asked:
        from atmoref import __version__

        print(f"atmoref {__version__}")
        raise typer.Exit(0)


def _about(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_version, help="Print the version and stop.")
    ] = False,
) -> None:
    """CPU reference of published GPU methods for light in the atmosphere: mirror, truth, verdict."""


@functools.cache
def application() -> Any:
    """Return the command with all its subcommands."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None, no_args_is_help=True)
    app.callback(invoke_without_command=False)(_about)
    for name, command in _COMMANDS:
        app.command(name)(_flushed(command))
    tables = typer.Typer(
        rich_markup_mode=None, no_args_is_help=True, help="Look-up tables: shipped, and in the user's cache."
    )
    for name, command in _TABLE_COMMANDS:
        tables.command(name)(_flushed(command))
    app.add_typer(tables, name="tables")
    particles = typer.Typer(rich_markup_mode=None, no_args_is_help=True, help="Phase functions of particles.")
    for name, command in _OPTICS_COMMANDS:
        particles.command(name)(_flushed(command))
    app.add_typer(particles, name="optics")
    return get_command(app)


def run(arguments: Sequence[str]) -> int:
    """Run one command; return its exit code after at most one message on stderr."""
    with _log_to_stderr():
        try:
            _check_environment()
            code = application().main(list(arguments), "atmoref", standalone_mode=False)
            return code if isinstance(code, int) else 0
        except SystemExit as stop:
            return stop.code if isinstance(stop.code, int) else WRONG_REQUEST
        except BaseException as error:  # the last place that can turn it into an exit code
            return report(error)


def report(error: BaseException) -> int:
    """Say what went wrong, once, and return the exit code."""
    if os.environ.get("ATMOREF_TRACEBACK") == "1":
        traceback.print_exception(error)
    if isinstance(error, typer.Abort):
        error = KeyboardInterrupt()
    if isinstance(error, _USAGE_ERROR):
        code, message = WRONG_REQUEST, _usage(error)
    else:
        code, message = verdict_of(error)
    if message:
        with contextlib.suppress(OSError):
            print(f"error: {message}", file=sys.stderr, flush=True)
    if isinstance(error, Signalled) and error.number == signal.SIGPIPE:
        with contextlib.suppress(OSError, ValueError):  # nothing is left that could be read
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _usage(error: Any) -> str:
    """Return a usage error as one line, with the command whose help tells more; help asked for by silence as it is."""
    message = str(error.format_message()).strip()
    if type(error).__name__ == "NoArgsIsHelpError":
        return f"no command was given\n{message}"
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "atmoref"
    return f"{message} (see {command} --help)"


def _check_environment() -> None:
    width = os.environ.get("ATMOREF_LANES", "16")
    if width not in LANE_WIDTHS:
        raise RequestError(f"ATMOREF_LANES: found {width!r}; allowed: {', '.join(LANE_WIDTHS)}")


@contextlib.contextmanager
def _log_to_stderr() -> Iterator[None]:
    """Show the package's warnings as lines of their own."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(levelname)s: %(message)s"))
    logger = logging.getLogger("atmoref")
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)

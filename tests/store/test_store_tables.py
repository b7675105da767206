"""Tables: built once, found again, rebuilt when damaged, whatever happens to the builder."""

import json
import logging
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from atmoref import store

ARRAYS = {"values": np.linspace(0, 1, 1000, dtype=np.float32).reshape(10, 100), "codes": np.arange(7, dtype=np.uint16)}
PARAMETERS = {"g": 0.1, "size": 64, "name": "q", "extent": [1.0, 2, [3.5, "m"]]}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ATMOREF_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def never() -> dict[str, np.ndarray]:
    raise AssertionError("built although it was stored")


def only_table(cache: Path) -> Path:
    (path,) = (cache / "tables").glob("*.npz")
    return path


def assert_arrays(arrays: dict[str, np.ndarray]) -> None:
    assert list(arrays) == list(ARRAYS)
    for name, array in arrays.items():
        assert array.dtype == ARRAYS[name].dtype
        assert array.flags.c_contiguous
        assert array.flags.writeable
        np.testing.assert_array_equal(array, ARRAYS[name])


def test_a_table_is_built_once(cache: Path) -> None:
    assert store.cache_root() == cache
    assert_arrays(store.load_or_build("q_table", 1, PARAMETERS, lambda: ARRAYS))
    assert_arrays(store.load_or_build("q_table", 1, dict(reversed(PARAMETERS.items())), never))
    assert only_table(cache).name == f"q_table-{store.table_key('q_table', 1, PARAMETERS)[:32]}.npz"


def test_equal_tables_are_equal_files(cache: Path) -> None:
    store.load_or_build("q_table", 1, PARAMETERS, lambda: ARRAYS)
    content = only_table(cache).read_bytes()
    assert store.clear_tables() == 1
    store.load_or_build("q_table", 1, PARAMETERS, lambda: {k: np.asfortranarray(v) for k, v in ARRAYS.items()})
    assert only_table(cache).read_bytes() == content


@pytest.mark.parametrize(
    ("kind", "version", "change"),
    [
        ("other", 1, {}),
        ("q_table", 2, {}),
        ("q_table", 1, {"g": np.nextafter(0.1, 1)}),
        ("q_table", 1, {"size": 64.0}),
        ("q_table", 1, {"extent": [1.0, 2, 3.5, "m"]}),
        ("q_table", 1, {"more": "0x1.0p+0"}),
    ],
)
def test_everything_a_table_depends_on_is_in_its_key(kind, version, change) -> None:
    before = store.table_key("q_table", 1, PARAMETERS)
    assert store.table_key(kind, version, PARAMETERS | change) != before


def test_key_is_the_same_in_every_process_and_version() -> None:
    """Written out by hand: kind, parameters (sorted, floats hexadecimal), version."""
    text = '{"kind":"a","parameters":{"b":[1,{"float":"0x1.8000000000000p+0"}],"c":"d"},"version":3}'
    expected = __import__("hashlib").sha256(text.encode()).hexdigest()
    assert store.table_key("a", 3, {"c": "d", "b": [1, 1.5]}) == expected


@pytest.mark.parametrize("wrong", [None, np.int32(1), {"a": 1}, 1j, np.zeros(2)])
def test_parameters_of_other_types_are_refused(wrong) -> None:
    with pytest.raises(TypeError, match="float, int, str or list"):
        store.table_key("q", 1, {"x": wrong})


@pytest.mark.parametrize("kind", ["", "Q", "../q", "q-1"])
def test_kinds_are_names(kind: str) -> None:
    with pytest.raises(ValueError, match="lower-case name"):
        store.table_key(kind, 1, {})


def flip(content: bytes, at: int) -> bytes:
    return content[:at] + bytes([content[at] ^ 0x10]) + content[at + 1 :]


@pytest.mark.parametrize("damage", ["truncated", "empty", "text", "flipped", "another table", "plain npz", "pickle"])
def test_damage_is_noticed_told_and_repaired(cache: Path, damage: str, caplog: pytest.LogCaptureFixture) -> None:
    store.load_or_build("q_table", 1, PARAMETERS, lambda: ARRAYS)
    path = only_table(cache)
    good = path.read_bytes()
    if damage == "another table":
        store.load_or_build("q_table", 2, PARAMETERS, lambda: ARRAYS)
        (other,) = (p for p in path.parent.glob("*.npz") if p != path)
        other.replace(path)
    elif damage == "plain npz":
        np.savez(path, **ARRAYS)
    elif damage == "pickle":
        np.savez(path, values=np.array([{}, None], object), allow_pickle=True)
    else:
        bad = {"truncated": good[: len(good) // 2], "empty": b"", "text": b"not a zip", "flipped": flip(good, 1500)}
        path.write_bytes(bad[damage])
    assert [e.path for e in store.verify_tables()] == ([] if damage == "another table" else [path])
    with caplog.at_level(logging.WARNING):
        assert_arrays(store.load_or_build("q_table", 1, PARAMETERS, lambda: ARRAYS))
    assert "unusable and is built again" in caplog.text
    assert path.read_bytes() == good
    assert store.verify_tables() == []
    assert_arrays(store.load_or_build("q_table", 1, PARAMETERS, never))


def test_every_single_flipped_byte_is_harmless(cache: Path) -> None:
    small = {"v": np.arange(6.0)}
    store.load_or_build("q_table", 1, {}, lambda: small)
    path = only_table(cache)
    good = path.read_bytes()
    for at in range(len(good)):
        path.write_bytes(flip(good, at))
        np.testing.assert_array_equal(store.load_or_build("q_table", 1, {}, lambda: small)["v"], small["v"])


def test_a_changed_value_with_a_valid_checksum_is_noticed(cache: Path) -> None:
    store.load_or_build("q_table", 1, {}, lambda: {"v": np.arange(6.0)})
    path = only_table(cache)
    arrays = store.read_npz(path)
    arrays["v"][3] += 1
    store.write_npz(path, arrays)
    (entry,) = store.verify_tables()
    assert "SHA-256" in str(entry.problem)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_interrupted_builder_leaves_nothing(cache: Path, error: type[BaseException]) -> None:
    def build() -> dict[str, np.ndarray]:
        raise error

    with pytest.raises(error):
        store.load_or_build("q_table", 1, {}, build)
    assert [p.suffix for p in (cache / "tables").iterdir()] == [".lock"]
    assert list(store.load_or_build("q_table", 1, {}, lambda: ARRAYS)) == list(ARRAYS)


def build_slowly(log: Path) -> dict[str, np.ndarray]:
    with open(log, "a") as out:
        out.write(f"{os.getpid()}\n")
    time.sleep(0.4)
    return ARRAYS


def race(log: Path) -> None:
    assert_arrays(store.load_or_build("q_table", 1, {}, lambda: build_slowly(log)))


def test_two_processes_build_once(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=race, args=(tmp_path / "log",)) for _ in range(2)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    assert [p.exitcode for p in processes] == [0, 0]
    assert len((tmp_path / "log").read_text().split()) == 1


def script(body: str, **environment: str) -> subprocess.Popen[str]:
    """Start a process that imports numpy and the store."""
    text = "import numpy as np, time, sys\nfrom atmoref import store\n" + textwrap.dedent(body)
    arguments = [sys.executable, "-c", text]
    return subprocess.Popen(arguments, env=os.environ | environment, stdout=-1, stderr=-1, text=True)


@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_builder_leaves_nothing_that_is_read(cache: Path, blow: signal.Signals) -> None:
    builder = script("""
        def build():
            print("building", flush=True)
            time.sleep(60)
        store.load_or_build("q_table", 1, {}, build)
    """)
    assert builder.stdout is not None
    assert builder.stdout.readline() == "building\n"
    builder.send_signal(blow)
    assert builder.wait(20) == -blow
    builder.communicate()
    assert not list((cache / "tables").glob("*.npz"))
    assert_arrays(store.load_or_build("q_table", 1, {}, lambda: ARRAYS))  # the lock died with its holder


def test_full_disk(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    try:
        with caplog.at_level(logging.WARNING):
            assert_arrays(store.load_or_build("q_table", 1, {}, lambda: ARRAYS))
        assert "cannot be kept" in caplog.text
        with pytest.raises(OSError, match=r"no room to write \(File too large\)"):
            store.load_or_build("q_table", 1, {}, lambda: ARRAYS, must_keep=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [p.suffix for p in (cache / "tables").iterdir()] == [".lock"]


def test_unwritable_cache_falls_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setenv("ATMOREF_CACHE_DIR", str(blocked / "cache"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for build in (lambda: ARRAYS, never):
        assert_arrays(store.load_or_build("q_table", 1, {}, build))


def test_list_and_clear(cache: Path) -> None:
    assert store.list_tables() == store.verify_tables() == []
    store.load_or_build("q_table", 1, PARAMETERS, lambda: ARRAYS)
    store.load_or_build("another", 2, {}, lambda: {"x": np.zeros(())})
    first, second = store.list_tables()
    assert (first.kind, first.version, first.parameters, first.problem) == ("another", 2, "{}", None)
    assert (second.kind, json.loads(second.parameters)["size"], len(second.sha256)) == ("q_table", 64, 64)
    assert second.bytes == second.path.stat().st_size
    assert store.load_or_build("another", 2, {}, never)["x"].shape == ()
    assert store.clear_tables() == 2
    assert store.list_tables() == []

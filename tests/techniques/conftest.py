"""Tables of random scenes go to a directory of their own, not to the user's cache."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import reference.replay  # noqa: F401  (fixes the directory of compiled kernels before the tables move)


@pytest.fixture(scope="package", autouse=True)
def _tables_elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ATMOREF_CACHE_DIR", str(tmp_path_factory.mktemp("tables")))
        yield

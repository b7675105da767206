"""What all tests share: the Hypothesis profile, and the rule for optional parts."""

from __future__ import annotations

import os
from collections.abc import Generator
from typing import Any

import pytest
from hypothesis import settings

# The gate repeats the same examples each time and never fails for slowness; HYPOTHESIS_PROFILE=explore looks further.
settings.register_profile("gate", deadline=None, derandomize=True, database=None)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "gate"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[Any]) -> Generator[None, Any, Any]:
    """Turn a skip for a missing optional part (reason "optional: ...") into a failure where REQUIRE_OPTIONAL=1."""
    report = yield
    if report.skipped and os.environ.get("REQUIRE_OPTIONAL") == "1" and isinstance(report.longrepr, tuple):
        reason = str(report.longrepr[2]).removeprefix("Skipped: ")
        if reason.startswith("optional:"):
            report.outcome = "failed"
            report.longrepr = f"REQUIRE_OPTIONAL=1 and this part is missing: {reason}"
    return report

"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings; a test that needs it is skipped, by name, where there is none."""
    folder = os.environ.get("MOTIONLAKE_DATA")
    if not folder:
        pytest.skip("MOTIONLAKE_DATA is not set: no real recordings here")
    return Path(folder)

"""Command lines are run in this process: what they do is tested here, not how a process starts and ends."""

from __future__ import annotations

import pytest


@pytest.fixture
def illum(illum_here):
    return illum_here

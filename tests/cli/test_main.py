"""How the command ends, whatever happens inside."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

ENDS = {
    "OSError(28, 'No space left on device', 'x.exr')": (1, "x.exr: No space left on device"),
    "ImportError('a\\n\\nOriginal error was: failed to map segment')": (1, "failed to map segment"),
    "MemoryError()": (4, "out of memory"),
    "KeyboardInterrupt()": (-signal.SIGINT, ""),
    "interrupted_import()": (-signal.SIGINT, ""),
}
SCRIPT = """
import sys
import illumcli.cli as cli

def interrupted_import():
    error = ImportError("initialization failed")
    error.__cause__ = KeyboardInterrupt()
    return error

def end(*words, **more):
    raise {}

cli.illum.main = end
cli.main()
"""


@pytest.mark.parametrize("error", ENDS)
def test_no_end_is_a_traceback(error):
    code, said = ENDS[error]
    words = [sys.executable, "-c", SCRIPT.format(error)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == bool(said)

"""Loaded by workers of tests (`--preload`): counts renders, and makes faults that the environment names.

ILLUM_TEST_LOG      file of a line "NAME began|written|kept" per render
ILLUM_TEST_DELAY    seconds that each render takes longer
ILLUM_TEST_DEATHS   folder; a file in it is removed, and the process killed, where a picture gets its name
ILLUM_TEST_FACTS    facts that this process has instead of its own, as "NAME=VALUE,..."
"""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from functools import wraps
from pathlib import Path

from illumcli.cluster import facts, task
from illumcli.commands.unit import Worker

LOG, DEATHS = os.environ.get("ILLUM_TEST_LOG"), os.environ.get("ILLUM_TEST_DEATHS")
# Dask may load this module twice.
run = getattr(Worker.run, "__wrapped__", Worker.run)
replace = getattr(os.replace, "__wrapped__", os.replace)


def note(work, what):
    if LOG:
        with open(LOG, "a") as log:
            log.write(f"{work.targets[0].path.name} {what}\n")


@wraps(run)
def counted(self, work, **more):
    note(work, "began")
    time.sleep(float(os.environ.get("ILLUM_TEST_DELAY", "0")))
    paths, report = run(self, work, **more)
    note(work, "written" if report.written else "kept")
    return paths, report


@wraps(replace)
def deadly(source, target, **more):
    for token in Path(DEATHS).iterdir() if Path(target).name.startswith("s-") else ():
        with suppress(FileNotFoundError):  # the other worker took it
            token.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
    replace(source, target, **more)


Worker.run = counted
if DEATHS:
    os.replace = deadly
if others := os.environ.get("ILLUM_TEST_FACTS"):
    own = {**facts.facts(), **dict(pair.split("=") for pair in others.split(","))}
    facts.facts = task.facts = lambda: own

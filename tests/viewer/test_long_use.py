"""Random use of the page for a long time: no errors on either side, and no memory that grows."""

from __future__ import annotations

import itertools
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from viewing import ViewPage

PAUSE = 0.15
"""Seconds between actions, at most: pictures are dropped half way, others completed."""
SETTLED = 120
"""Seconds after which memory must stay as it is."""

DO = """
const [pick, share] = [arguments[0], arguments[1]];
const all = (selector) => [...document.querySelectorAll(selector)];
const fire = (node, ...kinds) => {
  for (const kind of kinds) node.dispatchEvent(new Event(kind, {bubbles: true}));
};
const move = (slider, value) => { slider.value = value; fire(slider, 'input'); };
const one = (list) => list[Math.floor(share * list.length)];
const press = (selector) => document.querySelector(selector).click();
const frame = document.querySelector('#frame');
const pointer = (kind, x, y, more) => {
  const box = frame.getBoundingClientRect();
  const at = {clientX: box.left + x * box.width, clientY: box.top + y * box.height, ...more};
  frame.dispatchEvent(new PointerEvent(kind, {bubbles: true, pointerId: 1, ...at}));
};
const choose = (select) => {
  select.selectedIndex = Math.floor(Math.random() * select.options.length);
  fire(select, 'change');
};
const acts = {
  slide() {
    const slider = one(all('.control [type=range]'));
    for (let k = 0; k < 5; k++) move(slider, Math.random() * 200);
    fire(slider, 'change');
  },
  color() {
    const well = one(all('.control [type=color]'));
    well.value = '#' + Math.floor(Math.random() * 0xffffff).toString(16).padStart(6, '0');
    fire(well, 'input', 'change');
  },
  choose() { choose(one(all('.control select'))); },
  check() { one(all('.control [type=checkbox]')).click(); },
  lamp() { one(all('[data-light]')).click(); },
  look() { choose(one(all('#layer, #camera'))); },
  expose() { move(document.querySelector('#exposure'), 4 * share - 2); },
  hover() { pointer('pointermove', share, Math.random()); },
  drag() {
    pointer('pointerdown', 0.5, 0.5, {shiftKey: share < 0.3, button: 0});
    for (let k = 0; k < 6; k++) pointer('pointermove', 0.5 + 0.2 * Math.random(), 0.5 + 0.2 * Math.random());
    pointer('pointerup', 0.6, 0.5, {button: 0});
  },
  click() { for (const kind of ['pointerdown', 'pointerup']) pointer(kind, share, 0.6, {button: 0}); },
  wheel() { frame.dispatchEvent(new WheelEvent('wheel', {deltaY: 200 * share - 100, cancelable: true})); },
  freeze() { press('#freeze'); },
  brdf() { press('#brdf'); },
  compare() { choose(document.querySelector('#lobe-add')); },
  turn() { move(one(all('#theta, #phi')), 80 * share); },
  undo() { press('#undo'); },
  redo() { press('#redo'); },
  reset() { press('#reset'); },
  filter() { move(document.querySelector('#filter'), share < 0.5 ? '' : 'c'); },
  open() { const details = one(all('details')); details.open = !details.open; },
  fresh() { sessionStorage.clear(); location.reload(); },
};
acts[pick]();
"""
ACTS = (
    *("slide", "color", "drag", "hover", "wheel", "turn", "expose", "click", "choose") * 3,
    *("check", "lamp", "look", "freeze", "brdf", "compare", "undo", "redo", "filter", "open", "reset"),
)


class Measure:
    """Memory of the server and of the page [bytes], and the page's number of nodes."""

    def __init__(self, page, process):
        self.page = page
        self.process = process
        page.browser.execute_cdp_cmd("Performance.enable", {})

    def __call__(self):
        browser = self.page.browser
        browser.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
        metrics = {
            each["name"]: each["value"]
            for each in browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
        }
        resident = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * 4096
        return {"server": resident, "heap": metrics["JSHeapUsedSize"], "nodes": metrics["Nodes"]}


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads memory from /proc")
@pytest.mark.parametrize("seconds", [10, pytest.param(1800, marks=pytest.mark.slow)])
def test_random_use(chromium, scene, tmp_path, seconds):
    pytest.importorskip("websockets", reason="needs websockets")
    log = tmp_path / "stderr.txt"
    command = [sys.executable, "-m", "illumcli", "view", str(scene), "--no-browser", "-q"]
    with (
        log.open("w") as stderr,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True) as server,
    ):
        try:
            chromium.set_window_size(900, 500)
            chromium.get(server.stdout.readline().strip())
            measures = use(ViewPage(chromium), server, seconds)
        finally:
            chromium.get("about:blank")
            server.terminate()
    assert log.read_text() == ""
    assert [entry for entry in chromium.get_log("browser") if entry["source"] != "rendering"] == []
    settled = [each for at, each in measures if at >= SETTLED]
    for name in ("server", "heap", "nodes") if settled else ():
        series = [each[name] for each in settled]
        print(name, series[:: max(1, len(series) // 12)])
        third = len(series) // 3
        assert max(series[-third:]) <= 1.1 * max(series[: 2 * third]), name


def use(page, server, seconds):
    """Uses the page at random; returns (seconds, memory) at times when the page was as at its beginning."""
    page.drawn()
    measure = Measure(page, server)
    draw = random.Random(7)
    start = time.monotonic()
    measures = []
    for count in itertools.count(1):
        page.browser.execute_script(DO, draw.choice(ACTS), draw.random())
        time.sleep(draw.random() * PAUSE)
        if count % 200 == 0:
            page.browser.execute_script(DO, "fresh", 0)
            page.wait("document.querySelector('#status')?.dataset.stage === 'full'")
            measures.append((time.monotonic() - start, measure()))
        if time.monotonic() > start + seconds:
            break
        assert server.poll() is None
    page.browser.execute_script(DO, "reset", 0)
    page.drawn()
    return measures

"""Latency of the page of ``sim explore`` in Chromium: ``python -m benchmarks.explore``.

The page shows twelve sliders or more, measured points and the ghost of the start. A latency reaches from the event of
an input to the frame after the drawing. The load of the machine is printed, because latencies depend on it.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

import sim

SCENARIO = Path(__file__).parent.parent / "scenarios" / "pdms_lens.toml"
#: Key presses of a row; moves of the drag, at 60 Hz.
PRESSES, MOVES = 30, 120
#: Keeps when the figure was first painted, and for each input when it was painted with the values of the last one.
WATCH = """(() => {
    window.timing = { first: null, last: null, painted: null, redraws: 0 };
    const painted = (then) => requestAnimationFrame(() => {
        const channel = new MessageChannel();
        channel.port1.onmessage = () => then(performance.now());
        channel.port2.postMessage(0);
    });
    const begin = (event) => Object.assign(timing, { last: event.timeStamp, painted: null });
    document.addEventListener("input", begin, true);
    const watch = setInterval(() => {
        const plot = document.getElementById("plot");
        if (!plot || !plot.on) return;
        clearInterval(watch);
        painted((now) => { timing.first = performance.timeOrigin + now; });
        plot.on("plotly_afterplot", () => {
            timing.redraws += 1;
            const input = timing.last;
            const same = Object.keys(state.values).every((key) => shown.values[key][0] === state.values[key]);
            if (input !== null && same) painted((now) => {
                if (timing.last === input && timing.painted === null) timing.painted = now - input;
            });
        });
    }, 1);
})()"""

#: Moves a slider to places at 60 Hz, and returns the time that it took [ms]; a move that is late is made at once.
MOVE = """(item, places) => new Promise((done) => {
    const began = performance.now();
    let number = 0;
    const move = () => {
        item.value = places[number];
        item.dispatchEvent(new Event("input", { bubbles: true }));
        number += 1;
        if (number === places.length) done(performance.now() - began);
        else setTimeout(move, began + number * 1000 / 60 - performance.now());
    };
    move();
})"""


def main() -> None:
    """Measure, and print a row for each kind of latency [ms]."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        sys.exit("no Chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        table = Path(folder) / "points.csv"
        table.write_text(points(), encoding="utf-8")
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        began = time.time()
        command = [sys.executable, "-m", "sim", "explore", SCENARIO, "--no-browser", "--data", table]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            address = server.stdout.readline().split()[1]
            row("from the command to the painted page", [painted(browser.new_page(), address, began)])
            row("load of a warm server", [painted(browser.new_page(), address, time.time()) for _ in range(5)])
            page = browser.new_page(viewport={"width": 1200, "height": 900})
            painted(page, address, 0.0)
            page.wait_for_timeout(3000)
            print(f"{page.locator('#sliders input[type=range]').count()} sliders")
            row("key press", presses(page))
            row("last move of a drag", [dragged(page) for _ in range(3)])
            page.locator("#members").fill("100000")
            page.locator("#run").click()
            until(page, lambda: float(page.locator("#progress").get_attribute("value") or 0.0) > 0.0)
            row("key press beside an ensemble", presses(page))
            assert page.locator("#stop").is_enabled(), "the ensemble ended before the last press"
        finally:
            server.kill()
            server.wait()
            browser.close()


def points() -> str:
    """Return a table of measured curves at twelve speeds."""
    curves = sim.steady_curves(SCENARIO, np.geomspace(1e-4, 1e-2, 12))
    rows = zip(curves["speed"].to_numpy(), curves["contact_area"].to_numpy(), strict=True)
    return "\n".join(["speed [m/s],contact_area [m^2],contact_area_error [%]", *(f"{v},{a},1" for v, a in rows)])


def until(page: Page, holds: Callable[[], bool]) -> None:
    """Wait until something holds on a page."""
    for _ in range(6000):
        if holds():
            return
        page.wait_for_timeout(10)
    raise TimeoutError


def painted(page: Page, address: str, began: float) -> float:
    """Open the page, and return the time from a beginning [s since 1970] to its first painted figure [ms]."""
    page.add_init_script(WATCH)
    page.goto(address)
    until(page, lambda: page.evaluate("timing.first") is not None)
    return float(page.evaluate("timing.first")) - 1e3 * began


def latency(page: Page) -> float:
    """Return the latency of the last input [ms]."""
    until(page, lambda: page.evaluate("timing.painted") is not None)
    return float(page.evaluate("timing.painted"))


def presses(page: Page) -> list[float]:
    """Press a key on the sliders in turn; return the latencies [ms]."""
    sliders = page.locator("#sliders input[type=range]")
    result = []
    for number in range(PRESSES):
        slider = sliders.nth(number % sliders.count())
        slider.focus()
        page.evaluate("timing.last = timing.painted = null")
        page.keyboard.press("ArrowLeft" if slider.evaluate("(item) => item.value === item.max") else "ArrowRight")
        result.append(latency(page))
        page.wait_for_timeout(400)
    return result


def dragged(page: Page) -> float:
    """Move the first slider to and fro; return the latency of the last move [ms].

    The page itself makes the events, because a driver waits for the page after each move and so keeps no pace.
    """
    places = (150.0 + 90.0 * np.sin(np.linspace(0.0, 6.0, MOVES))).round().tolist()
    slider = page.locator("#sliders input[type=range]").first
    page.evaluate("timing.redraws = 0")
    seconds = slider.evaluate(MOVE, places) / 1e3
    result = latency(page)
    slider.dispatch_event("change")
    print(f"  {MOVES} moves in {seconds:.2f} s, {page.evaluate('timing.redraws')} redraws")
    page.wait_for_timeout(1000)
    return result


def row(name: str, values: list[float]) -> None:
    """Print the median and the 95th percentile of latencies, with the load of the machine."""
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    low, high = np.percentile(values, [50.0, 95.0])
    print(f"{name}: median {low:.0f} ms, 95 % {high:.0f} ms, of {len(values)}; load {load}", flush=True)


if __name__ == "__main__":
    main()

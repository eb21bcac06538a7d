"""Latency of the page of ``sim explore`` in Chromium: ``python -m benchmarks.explore``.

The page shows eighteen sliders, measured points and the ghost of the start. A latency reaches from the event of an
input to the curve of its values in the document, and further to the frame in which it is painted. The end of a job
reaches from a click, a closed tab, a reload or a signal to the end of its process. The load of the machine is printed,
because latencies depend on it.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psutil
from playwright.sync_api import Browser, Page, sync_playwright

import sim

SCENARIO = Path(__file__).parent.parent / "scenarios" / "pdms_lens.toml"
#: Key presses of a row; moves of the drag, at 60 Hz.
PRESSES, MOVES = 30, 120
#: Keeps when the figure was first painted, and for each input when it was painted with the values of the last one.
WATCH = """(() => {
    window.timing = { first: null, last: null, drawn: null, painted: null, redraws: 0 };
    const painted = (then) => requestAnimationFrame(() => {
        const channel = new MessageChannel();
        channel.port1.onmessage = () => then(performance.now());
        channel.port2.postMessage(0);
    });
    const begin = (event) => Object.assign(timing, { last: event.timeStamp, drawn: null, painted: null });
    document.addEventListener("input", begin, true);
    const drawn = () => {
        const plot = document.getElementById("plot");
        if (timing.first === null) painted((now) => { timing.first = performance.timeOrigin + now; });
        timing.redraws += 1;
        const input = timing.last;
        if (input === null || plot.dataset.of !== JSON.stringify(explored.values)) return;
        timing.drawn ??= performance.now() - input;
        painted((now) => {
            if (timing.last === input && timing.painted === null) timing.painted = now - input;
        });
    };
    document.addEventListener("DOMContentLoaded", () => {
        const plot = document.getElementById("plot");
        new MutationObserver(drawn).observe(plot, { attributeFilter: ["data-of"] });
    });
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
    chromium = next(
        filter(
            None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))
        ),
        None,
    )
    if chromium is None:
        sys.exit("no Chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        table = Path(folder) / "points.csv"
        table.write_text(points(), encoding="utf-8")
        browser = driver.chromium.launch(
            executable_path=chromium, args=["--no-sandbox"]
        )
        began = time.time()
        with served("--data", table) as (_, address):
            row(
                "from the command to the painted page",
                [painted(browser.new_page(), address, began)],
            )
            row(
                "load of a warm server",
                [painted(browser.new_page(), address, time.time()) for _ in range(5)],
            )
            page = browser.new_page(viewport={"width": 1200, "height": 900})
            painted(page, address, 0.0)
            page.wait_for_timeout(3000)
            print(f"{page.locator('#groups input[type=range]').count()} sliders")
            latencies("key press", presses(page))
            latencies("last move of a drag", [dragged(page) for _ in range(3)])
            page.locator("#members").fill("100000")
            page.locator("#run").click()
            until(
                page,
                lambda: (
                    float(page.locator("#progress").get_attribute("value") or 0.0) > 0.0
                ),
            )
            latencies("key press beside an ensemble", presses(page))
            assert page.locator("#stop").is_enabled(), (
                "the ensemble ended before the last press"
            )
        for name in ENDS:
            row(f"end of a job by {name}", [ended(browser, name) for _ in range(3)])
        browser.close()


@contextlib.contextmanager
def served(*options: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process of ``sim explore``, and the address that it prints."""
    command = [
        sys.executable,
        "-m",
        "sim",
        "explore",
        SCENARIO,
        "--no-browser",
        *map(str, options),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            yield server, server.stdout.readline().split()[1]
        finally:
            server.kill()


def ended(browser: Browser, name: str) -> float:
    """Begin a job and end it; return the time to the end of its process, or of the server after Ctrl-C [ms]."""
    with served("--set", "clock.duration=10000 s") as (server, address):
        page = browser.new_page()
        page.goto(address)
        until(page, page.locator("#scene").text_content)
        page.locator("#members").fill("100000")
        page.locator("#run").click()
        parent = psutil.Process(server.pid)
        until(page, parent.children)
        page.wait_for_timeout(3000)  # it computes by then
        processes = parent.children(recursive=True) + [parent] * (name == "Ctrl-C")
        began = time.perf_counter()
        ENDS[name](page, server)
        while any(is_alive(process) for process in processes):
            time.sleep(0.005)
        return 1e3 * (time.perf_counter() - began)


def is_alive(process: psutil.Process) -> bool:
    """Return True if a process runs; one that has ended may still be in the list, if nobody asks for its result."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    return False


#: Ways in which a job ends.
ENDS: dict[str, Callable[[Page, subprocess.Popen[str]], object]] = {
    "a click on stop": lambda page, server: page.locator("#stop").click(),
    "a closed tab": lambda page, server: page.close(),
    "a reload": lambda page, server: page.reload(wait_until="commit"),
    "Ctrl-C": lambda page, server: server.send_signal(signal.SIGINT),
    "kill -9 of the server": lambda page, server: server.kill(),
}


def points() -> str:
    """Return a table of measured curves at twelve speeds."""
    curves = sim.steady_curves(SCENARIO, np.geomspace(1e-4, 1e-2, 12))
    rows = zip(
        curves["speed"].to_numpy(), curves["contact_area"].to_numpy(), strict=True
    )
    return "\n".join(
        [
            "speed [m/s],contact_area [m^2],contact_area_error [%]",
            *(f"{v},{a},1" for v, a in rows),
        ]
    )


def until(page: Page, holds: Callable[[], object]) -> None:
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


def latency(page: Page) -> tuple[float, float]:
    """Return the time from the last input to its curve in the document, and to its painted frame [ms]."""
    until(page, lambda: page.evaluate("timing.painted") is not None)
    drawn, shown = page.evaluate("[timing.drawn, timing.painted]")
    return float(drawn), float(shown)


def latencies(name: str, pairs: list[tuple[float, float]]) -> None:
    """Print a row for the time to the curve in the document, and one for that to the painted frame."""
    for end, values in zip(("curve", "painted"), zip(*pairs, strict=True), strict=True):
        row(f"{name}, {end}", [*values])


def presses(page: Page) -> list[tuple[float, float]]:
    """Press a key on the sliders in turn; return the latencies [ms]."""
    sliders = page.locator("#groups input[type=range]")
    result = []
    for number in range(PRESSES):
        slider = sliders.nth(number % sliders.count())
        slider.focus()
        page.evaluate("timing.last = timing.drawn = timing.painted = null")
        page.keyboard.press(
            "ArrowLeft"
            if slider.evaluate("(item) => item.value === item.max")
            else "ArrowRight"
        )
        result.append(latency(page))
        page.wait_for_timeout(400)
    return result


def dragged(page: Page) -> tuple[float, float]:
    """Move the first slider to and fro; return the latencies of the last move [ms].

    The page itself makes the events, because a driver waits for the page after each move and so keeps no pace.
    """
    places = (150.0 + 90.0 * np.sin(np.linspace(0.0, 6.0, MOVES))).round().tolist()
    slider = page.locator("#groups input[type=range]").first
    page.evaluate("timing.redraws = 0")
    seconds = slider.evaluate(MOVE, places) / 1e3
    result = latency(page)
    slider.dispatch_event("change")
    print(
        f"  {MOVES} moves in {seconds:.2f} s, {page.evaluate('timing.redraws')} redraws"
    )
    page.wait_for_timeout(1000)
    return result


def row(name: str, values: list[float]) -> None:
    """Print the median and the 95th percentile of latencies, with the load of the machine."""
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    low, high = np.percentile(values, [50.0, 95.0])
    print(
        f"{name}: median {low:.0f} ms, 95 % {high:.0f} ms, of {len(values)}; load {load}",
        flush=True,
    )


if __name__ == "__main__":
    main()

"""The page of ``sim explore`` in a browser: what it shows, what it asks for, keyboard, small screens and the dark."""

import contextlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import psutil
import pytest
from helpers.commands import COUNTED, LENS, RAMP
from helpers.firefox import firefox
from numpy.testing import assert_allclose

import sim
from sim.explorer.page import Page
from sim.scenario.schema import quantities
from sim.study.curves import curves as steady

playwright = pytest.importorskip("playwright.sync_api", reason="in the extra verify")
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    "",
)
FIREFOX = next(filter(None, map(shutil.which, ("firefox-esr", "firefox"))), "")
pytestmark = [
    pytest.mark.verify,
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium"),
    pytest.mark.filterwarnings("default"),  # those of the driver of the browser
]

BONDS = '[bonds]\nmodel = "steady"\ncritical_speed = "10 mm/s"\nstress = "0.3 MPa"\n'
WAVES = '[shear]\nmodel = "mean"\nspectrum = { model = "gaussian", rms = "60 kPa", length = "4 um" }\n'
SCENE = (
    LENS.replace(
        "a scene", "</title><script>alert(1)</script><img src=x onerror=alert(1)>"
    )
    + RAMP
    + BONDS
    + WAVES
)
#: A scene whose ensembles take minutes.
LONG = LENS.replace('duration = "1 s"', 'duration = "10000 s"') + RAMP + COUNTED
RADIUS = "sphere.radius"
#: Gestures of one random walk; there are ten walks.
GESTURES = 200
FILL = "(item) => getComputedStyle(item).fill"
ALERT = "[role=alert]:not([hidden])"
#: The inputs of a page that are seen; their names with widths and heights; its texts with their contrasts.
VISIBLE = '[...document.querySelectorAll("input, select, button")].filter((item) => item.offsetParent)'
SIZES = f"""{VISIBLE}.map((item) => {{
    const box = (item.type === "checkbox" ? item.labels[0] : item).getBoundingClientRect();
    return [item.id || item.value, box.width, box.height];
}})"""
CONTRAST = """[...document.querySelectorAll("body, body *")].flatMap((item) => {
    const part = (value) => (value <= 10 ? value / 3294 : ((value / 255 + 0.055) / 1.055) ** 2.4);
    const light = ([r, g, b]) => 0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b);
    const parts = (colour) => { const found = colour.match(/[0-9.]+/g).map(Number);
        return [...found.slice(0, 3), found[3] ?? 1]; };
    const over = ([r, g, b, a], low) => [r, g, b].map((value, k) => a * value + (1 - a) * low[k]);
    const back = (at) => { const colour = parts(getComputedStyle(at).backgroundColor);
        return colour[3] === 1 || !at.parentElement ? colour : over(colour, back(at.parentElement)); };
    const own = [...item.childNodes].filter((node) => node.nodeType === 3).map((node) => node.data).join("").trim();
    const text = own || (/^(range|checkbox)$/.test(item.type) ? "" : item.value || "");
    const look = getComputedStyle(item);
    const isShown = item.getClientRects().length && !["NOSCRIPT", "SCRIPT", "STYLE", "OPTION"].includes(item.tagName);
    if (!text || !isShown) return [];
    const low = back(item).slice(0, 3);
    const ink = light(over(parts(item instanceof SVGElement ? look.fill : look.color), low));
    return [[text, (Math.max(ink, light(low)) + 0.05) / (Math.min(ink, light(low)) + 0.05)]];
})"""


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


@contextlib.contextmanager
def explored(path, *options, browse="--no-browser"):
    """The process of ``sim explore`` on a scenario, and the address that it prints."""
    command = [
        sys.executable,
        "-m",
        "sim",
        "explore",
        str(path),
        browse,
        *map(str, options),
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            line = process.stdout.readline()
            assert line.startswith("open http://127.0.0.1:"), line
            yield process, line.split()[1]
        finally:
            with contextlib.suppress(psutil.NoSuchProcess):
                # a browser that it opened
                for child in psutil.Process(process.pid).children(recursive=True):
                    child.kill()
            process.kill()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    with explored(path) as (_, address):
        yield address


@pytest.fixture
def shown(browser, served):
    """A page of the scene, with all that its console said and all addresses that it asked for."""
    with opened(browser, served) as page:
        yield page


@contextlib.contextmanager
def opened(browser, address, **options):
    context = browser.new_context(
        **{"viewport": {"width": 1200, "height": 900}} | options
    )
    page = context.new_page()
    page.said, page.asked = [], []
    page.on("console", lambda message: page.said.append(message.text))
    page.on("pageerror", lambda fault: page.said.append(str(fault)))
    page.on("dialog", lambda dialog: page.said.append(f"dialog: {dialog.message}"))
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(address)
    settled(page)
    yield page
    context.close()


def wait(page, holds, text):
    """Wait until something holds on a page."""
    for _ in range(300):
        if holds():
            return
        page.wait_for_timeout(50)
    raise AssertionError(text)


def settled(page):
    wait(page, lambda: bool(page.locator("#scene").text_content()), "no contact")


def value(page, key=RADIUS):
    return page.locator(f"[id='text {key}']").input_value()


def enter(page, text, key=RADIUS):
    field = page.locator(f"[id='text {key}']")
    field.fill(text)
    field.press("Enter")


def lost(page):
    return page.locator("#lost").text_content()


def test_a_page_asks_for_nothing_beyond_its_server_and_shows_a_hostile_name_as_text(
    shown,
):
    assert "<script>alert(1)</script>" in shown.locator("#title").text_content()
    assert (
        shown.locator("h1 script, h1 img").count() == 0
        and shown.locator("#plot svg a").count() == 0
    )
    shown.locator("#run").click()
    wait(
        shown,
        lambda: "members are equal" in shown.locator("#ran").text_content(),
        "no ensemble",
    )
    assert {
        re.match(r"(blob:)?http://127\.0\.0\.1:\d+/", url) is not None
        for url in shown.asked
    } == {True}
    assert shown.said == []
    assert "token" not in shown.url


def test_a_slider_changes_curves_words_and_address_and_undo_takes_each_gesture_back(
    shown,
):
    before, words = value(shown), lost(shown)
    slider = shown.locator(f"[id='{RADIUS}']")
    slider.focus()
    for _ in range(3):
        shown.keyboard.press("ArrowRight")
    wait(
        shown,
        lambda: value(shown) != before and lost(shown) != words,
        "nothing changed",
    )
    wait(shown, lambda: RADIUS in shown.url, "not in the address")
    wait(
        shown,
        lambda: slider.get_attribute("aria-valuetext") == value(shown),
        "another text for a screen reader",
    )
    shown.locator("#undo").click()  # of all presses, which are one gesture
    wait(shown, lambda: (value(shown), lost(shown)) == (before, words), "not undone")
    assert shown.locator("#undo").is_disabled()
    shown.locator("#redo").click()
    wait(shown, lambda: lost(shown) != words, "not done again")
    enter(shown, "3 mm")
    wait(shown, lambda: f"{RADIUS}=0.003" in shown.url, "not read")
    shown.reload()
    settled(shown)
    assert value(shown) == "3 mm"
    shown.locator("#level").focus()
    shown.keyboard.press("ArrowRight")
    wait(shown, lambda: lost(shown).startswith("11 %"), "no other level")
    shown.locator("#undo").click()
    wait(
        shown,
        lambda: lost(shown).startswith("10 %") and value(shown) == "3 mm",
        "another gesture is undone as well",
    )
    shown.locator("#reset").click()
    wait(shown, lambda: (value(shown), lost(shown)) == (before, words), "not reset")


def test_a_text_that_cannot_be_read_leaves_the_value_and_states_the_reason(shown):
    words = lost(shown)
    enter(shown, "3 kg")
    wait(shown, lambda: shown.locator(ALERT).count() == 1, "no message")
    assert "is not a unit of m" in shown.locator(ALERT).text_content()
    assert (
        shown.locator(f"[id='text {RADIUS}']").get_attribute("aria-invalid") == "true"
    )
    assert lost(shown) == words and RADIUS not in shown.url
    enter(shown, "2 mm")
    wait(shown, lambda: shown.locator(ALERT).count() == 0, "the message stays")


def drop(page, content, name):
    page.evaluate(
        """([content, name]) => {
            const data = new DataTransfer();
            data.items.add(new File([content], name));
            dispatchEvent(new DragEvent("drop", { dataTransfer: data }));
        }""",
        [content, name],
    )


def saved(page, kind):
    page.locator("#save summary").click()
    with page.expect_download() as download:
        page.locator(f"#save [data-kind={kind}]").click()
    return Path(download.value.path())


def test_the_curves_are_those_of_a_run_of_the_saved_scenario(shown, tmp_path):
    enter(shown, "2.7 mm")
    wait(shown, lambda: RADIUS in shown.url, "not read")
    path = tmp_path / "saved.toml"
    shutil.copy(saved(shown, "toml"), path)
    curves = shown.evaluate(
        "({ speed: explored.answers.curves.answer.x, ...explored.answers.curves.answer.curves })"
    )
    for place in (0, 60, 120):
        still = {"drive": {"model": "steady", "speed": curves["speed"][place]}}
        run = sim.run(sim.load(path, still))
        for name in ("contact_area", "friction_force", "fluctuation_energy"):
            assert_allclose(curves[name][place], float(run[name][-1]), rtol=1e-12)
    for kind, magic in (
        ("png", b"\x89PNG"),
        ("svg", b"<svg xmlns"),
        ("csv", b"speed [m/s]"),
    ):
        assert saved(shown, kind).read_bytes().startswith(magic)


def test_a_table_with_decimal_commas_is_dropped_fitted_saved_and_opened_again(
    browser, tmp_path
):
    path = tmp_path / "lens.toml"
    path.write_text(LENS + RAMP.replace("ramp", "ramp") + BONDS, encoding="utf-8")
    exact = sim.steady_curves(
        sim.load(path, {"bonds.critical_speed": "5 mm/s"}), [1e-3, 3e-3, 1e-2, 1.9e-2]
    )
    rows = zip(exact["speed"].to_numpy(), exact["contact_area"].to_numpy(), strict=True)
    lines = [f"{1e3 * v:.4f};{1e6 * a:.9f};1".replace(".", ",") for v, a in rows]
    content = "\n".join(
        ["speed [mm/s];contact_area [mm^2];contact_area_error [%]", *lines]
    )
    with explored(path) as (_, address), opened(browser, address) as page:
        assert not page.get_by_text("Fit these numbers").is_visible()
        drop(page, content, "<img src=x onerror=alert(1)>.csv")
        wait(page, lambda: "χ²" in page.locator("#judged").text_content(), "no points")
        assert page.locator("#judged img").count() == 0
        page.locator("#free input[value='bonds.critical_speed']").check()
        page.locator("#fit").click()
        wait(page, lambda: page.locator("#fitted").is_visible(), "no fit")
        wait(
            page,
            lambda: value(page, "bonds.critical_speed") in ("5 mm/s", "5.000 mm/s"),
            "not the exact speed",
        )
        assert page.locator(".track svg").count() == 1
        idle(page)
        wait(page, lambda: "bonds.critical_speed" in page.url, "not in the address")
        link, words = page.url, lost(page)
    with (
        explored(path, "--state", link) as (_, address),
        opened(browser, address) as page,
    ):
        assert lost(page) == words


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_has_contrast(browser, served, scheme):
    with opened(browser, served, color_scheme=scheme) as page:
        drop(
            page,
            "speed [mm/s],contact_area [mm^2],contact_area_error [%]\n1,0.04,1\n9,0.03,1",
            "own.csv",
        )
        wait(page, lambda: page.locator("#free input").count() > 5, "no points")
        enter(page, "3 kg")
        page.locator("#run").click()
        wait(
            page,
            lambda: "members are equal" in page.locator("#ran").text_content(),
            "no ensemble",
        )
        wait(page, lambda: page.locator(ALERT).count() == 1, "no message")
        texts = page.evaluate(CONTRAST)
        assert len(texts) > 100 and {"Numbers", "measured", "3 kg", "Undo"} <= {
            text for text, _ in texts
        }
        assert [text for text in texts if text[1] < 4.5] == []


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_the_token_is_in_no_process_list_log_or_address(browser, tmp_path, monkeypatch):
    path, profile = tmp_path / "long.toml", tmp_path / "profile"
    path.write_text(LONG, encoding="utf-8")
    options = (
        f"--headless --no-sandbox --remote-debugging-port=0 --user-data-dir={profile}"
    )
    # as the command opens a browser by itself
    monkeypatch.setenv("BROWSER", f"{CHROMIUM} {options} %s &")
    with explored(path, browse="--browser") as (process, address):
        token = address.partition("token=")[2]
        end = time.monotonic() + 60.0
        while (
            not (port := profile / "DevToolsActivePort").exists()
            and time.monotonic() < end
        ):
            time.sleep(0.1)
        driven = browser.browser_type.connect_over_cdp(
            f"http://127.0.0.1:{port.read_text().split()[0]}"
        )
        page = driven.contexts[0].pages[0]
        settled(page)
        page.locator("#run").click()
        wait(
            page,
            lambda: any("sim.explorer.job" in line for line in command_lines()),
            "no job",
        )
        shown = command_lines()
        assert len(token) > 40 and any("open.html" in line for line in shown)
        assert not [line for line in shown if token in line] and "token" not in page.url
        visited = page.context.new_cdp_session(page).send("Page.getNavigationHistory")[
            "entries"
        ]
        assert not [entry for entry in visited if token in entry["url"]]
        driven.new_browser_cdp_session().send("Browser.close")
        process.send_signal(signal.SIGINT)
        assert token not in process.stdout.read()


def command_lines():
    """The process list, as any user of the machine reads it."""
    return [
        " ".join(process.info["cmdline"] or ())
        for process in psutil.process_iter(["cmdline"])
    ]


def jobs(process):
    with contextlib.suppress(psutil.Error):
        children = psutil.Process(process.pid).children(recursive=True)
        return [
            child.pid for child in children if child.status() != psutil.STATUS_ZOMBIE
        ]
    return []


def alive(pids):
    return [
        pid
        for pid in pids
        if psutil.pid_exists(pid)
        and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    ]


@pytest.fixture
def long(tmp_path):
    """A server of a scene whose ensembles take minutes."""
    path = tmp_path / "long.toml"
    path.write_text(LONG, encoding="utf-8")
    with explored(path) as served:
        yield served


def begun(page, process):
    page.locator("#members").fill("100000")
    page.locator("#run").click()
    wait(page, lambda: len(jobs(process)) == 1, "no job")
    return jobs(process)


@pytest.mark.parametrize("how", ["stop", "close", "reload"])
def test_a_job_ends_with_stop_a_closed_tab_and_a_reload(browser, long, how):
    process, address = long
    with opened(browser, address) as page:
        begun(page, process)
        {
            "stop": page.locator("#stop").click,
            "close": page.close,
            "reload": page.reload,
        }[how]()
        end = time.monotonic() + 20.0
        while jobs(process) and time.monotonic() < end:
            time.sleep(0.05)
        assert not jobs(process)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
@pytest.mark.parametrize("order", [signal.SIGINT, signal.SIGKILL])
def test_a_server_that_is_stopped_or_killed_takes_its_jobs_along(browser, long, order):
    process, address = long
    with opened(browser, address) as page:
        pids = begun(page, process)
        process.send_signal(order)
        process.wait(20.0)
        end = time.monotonic() + 20.0
        while alive(pids) and time.monotonic() < end:
            time.sleep(0.05)
        assert not alive(pids)
        if order == signal.SIGINT:
            # no trace, only the hint
            assert process.returncode == 0 and process.stdout.read().count("\n") == 1
        enter(page, "3 mm")
        wait(
            page,
            lambda: "server has ended" in page.locator(ALERT).first.text_content(),
            "no message",
        )


def test_the_whole_page_is_played_by_keyboard_and_all_inputs_have_names(shown):
    names = shown.evaluate(
        f"{VISIBLE}.map((item) => (item.labels?.[0]?.textContent || item.ariaLabel || item.textContent))"
    )
    assert len(names) > 30 and all(name.strip() for name in names)
    shown.locator("body").click(position={"x": 2, "y": 2})
    seen = []
    for _ in range(60):
        shown.keyboard.press("Tab")
        seen.append(shown.evaluate("document.activeElement.id"))
    for key in f"undo redo reset level at absolute first loads {RADIUS} members run file".split():
        assert key in seen or shown.locator(f"[id='{key}']").is_disabled(), key
    assert seen.index(RADIUS) + 1 == seen.index(f"text {RADIUS}")
    shown.locator("#absolute").focus()
    shown.keyboard.press("Space")
    wait(
        shown,
        lambda: "mm²" in shown.locator("#plot .ytitle").first.text_content(),
        "no areas",
    )
    shown.locator("#level").focus()
    words = lost(shown)
    shown.keyboard.press("ArrowRight")
    wait(
        shown,
        lambda: lost(shown) != words and lost(shown).startswith("11 %"),
        "no other level",
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_small_screen_has_no_sideways_scroll_large_targets_and_contrast(
    browser, served, scheme
):
    small = {
        "viewport": {"width": 390, "height": 800},
        "color_scheme": scheme,
        "has_touch": True,
        "is_mobile": True,
    }
    with opened(browser, served, **small) as page:
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert [size for size in page.evaluate(SIZES) if min(size[1:]) < 24] == []
        title, back = (
            page.locator("#plot .ytitle").first,
            "getComputedStyle(document.body).backgroundColor",
        )
        before = page.evaluate(back), title.evaluate(FILL)
        page.emulate_media(color_scheme={"light": "dark", "dark": "light"}[scheme])
        wait(
            page,
            lambda: title.evaluate(FILL) != before[1],
            "the figure stays",
        )
        assert page.evaluate(back) != before[0]


def test_a_small_screen_cuts_neither_the_sentence_nor_a_label(browser):
    with scenario(browser, "pdms_lens", viewport={"width": 390, "height": 800}) as page:
        wait(page, lambda: page.locator("#plot [data-name=own]").count(), "no band")
        idle(page)
        assert "masked between" in lost(page)
        clipped = "(item) => item.scrollHeight > item.clientHeight"
        assert not page.locator("#lost").evaluate(clipped)
        ends = page.locator("#plot svg text").evaluate_all(
            "(each) => each.map((one) => one.getBoundingClientRect().right)"
        )
        assert max(ends) <= page.locator("#plot svg").evaluate(
            "(item) => item.getBoundingClientRect().right"
        )
        # the table has the panels of a wider screen, too
        page.locator("#numbers summary").click()
        wait(page, lambda: page.locator("#numbers th").count() > 4, "no table")
        assert "F (mN)" in page.locator("#numbers th").all_text_contents()


def test_a_picture_without_room_is_drawn_without_a_fault(shown):
    shown.locator("#words").evaluate("(item) => (item.style.display = 'none')")
    enter(shown, "8 mN", LOAD)
    idle(shown)
    assert shown.said == []


def test_the_order_of_subtraction_is_a_choice_only_of_two_mechanisms(browser):
    for name, has_order in (("pdms_lens", True), ("masking", False)):
        with scenario(browser, name) as page:
            idle(page)
            assert page.locator("#first").is_visible() == has_order


def test_a_swipe_over_the_figure_scrolls_the_page(browser, served):
    with opened(
        browser,
        served,
        viewport={"width": 390, "height": 800},
        has_touch=True,
        is_mobile=True,
    ) as page:
        session = page.context.new_cdp_session(page)
        for kind, y in (
            ("touchStart", 250),
            *(("touchMove", 250 - 10 * k) for k in range(1, 16)),
            ("touchEnd", None),
        ):
            points = [] if y is None else [{"x": 200, "y": y}]
            session.send(
                "Input.dispatchTouchEvent", {"type": kind, "touchPoints": points}
            )
            page.wait_for_timeout(16)
        page.wait_for_timeout(400)
        assert page.evaluate("scrollY") > 50


@pytest.mark.parametrize("name", ["pdms_lens_spring", "own_map", "pull_off"])
def test_a_scenario_that_steady_sliding_does_not_answer_opens_with_its_motion(
    browser, name
):
    path = Path(sim.__file__).parents[1] / "scenarios" / f"{name}.toml"
    with explored(path) as (_, address), opened(browser, address) as page:
        wait(page, lambda: lost(page).startswith("First member"), "no motion")
        assert not page.locator("#preview").is_visible()
        page.get_by_label("over the sliding speed").check()
        words = "Preview: steady sliding is not what"
        wait(
            page,
            lambda: page.locator("#preview").is_visible(),
            "not called a preview",
        )
        assert page.locator("#preview").text_content().startswith(words)


IDLE = """async () => {
    const { due } = await import("/answer.js");
    const { nextOfMotion } = await import("/state.js");
    const { values, answers } = explored;
    const plot = document.getElementById("plot").dataset;
    if (document.querySelector("[aria-busy=true]")) return false;
    return due(explored).length === 0 && nextOfMotion(explored) === null && plot.of === JSON.stringify(values);
}"""


def idle(page):
    """Wait until all answers are those of the present numbers, and are drawn."""
    wait(page, lambda: page.evaluate(IDLE), "never at rest")


@pytest.fixture
def random(browser, tmp_path):
    """A page of a scene whose members differ."""
    path = tmp_path / "random.toml"
    path.write_text(LENS + RAMP + COUNTED, encoding="utf-8")
    with explored(path) as (_, address), opened(browser, address) as page:
        yield page


@contextlib.contextmanager
def scenario(browser, name, *options, **looks):
    path = Path(sim.__file__).parents[1] / "scenarios" / f"{name}.toml"
    with (
        explored(path, *options) as (_, address),
        opened(browser, address, **looks) as page,
    ):
        yield page


LOAD = "contact.load"


def run(page, members):
    page.locator("#members").fill(str(members))
    page.locator("#run").click()


def test_an_ensemble_of_other_numbers_is_drawn_as_such(random):
    run(random, 64)
    enter(random, "16 mN", LOAD)
    ran = random.locator("#ran")
    wait(random, lambda: "64 members" in ran.text_content(), "no ensemble")
    idle(random)
    assert "of earlier numbers: ran at P = 4 mN" in ran.text_content()
    assert random.locator("#plot [data-name=ran]").count()
    assert "ran at P = 4 mN" in random.locator("#plot").text_content()
    random.locator("#undo").click()
    idle(random)
    assert "earlier" not in ran.text_content()
    assert not random.locator("#plot [data-name=ran]").count()
    assert "mean of 64 members" in random.locator("#plot").text_content()
    random.locator("#members").fill("")
    random.locator("#run").click()
    wait(random, lambda: "between 1 and 100000" in ran.text_content(), "no reason")


def points(path, speeds, key="bonds.critical_speed", value="5 mm/s"):
    exact = sim.steady_curves(sim.load(path, {key: value}), speeds)
    rows = zip(exact["speed"].to_numpy(), exact["contact_area"].to_numpy(), strict=True)
    lines = [f"{1e3 * v},{1e6 * a},1" for v, a in rows]
    return "\n".join(
        ["speed [mm/s],contact_area [mm^2],contact_area_error [%]", *lines]
    )


@pytest.fixture
def lens(tmp_path):
    path = tmp_path / "lens.toml"
    path.write_text(LENS + RAMP + BONDS, encoding="utf-8")
    return path


def test_a_fit_in_flight_moves_no_slider_of_another_state(browser, lens):
    with explored(lens) as (_, address), opened(browser, address) as page:
        drop(page, points(lens, [1e-3, 3e-3, 1e-2]), "own.csv")
        wait(page, lambda: "χ²" in page.locator("#judged").text_content(), "no points")
        page.locator("#fit").click()
        assert "tick the numbers" in page.locator("#unfit").text_content()
        page.locator("#free input[value='bonds.critical_speed']").check()
        page.locator("#fit").click()
        enter(page, "16 mN", LOAD)
        wait(page, lambda: page.locator("#fitted").is_visible(), "no fit")
        idle(page)
        assert value(page, "bonds.critical_speed") == "10 mm/s"
        assert "earlier numbers" in page.locator("#earlier").text_content()
        assert page.locator(".track svg").count() == 0
        page.locator("#undo").click()
        page.locator("#use").click()
        idle(page)
        assert page.locator(".track svg").count() == 1
        assert not page.locator("#earlier").is_visible()
        # a reload keeps table, fit and what can be undone
        page.reload()
        settled(page)
        idle(page)
        assert page.locator(".track svg").count() == 1
        assert "χ²" in page.locator("#judged").text_content()
        page.locator("#undo").click()
        idle(page)
        assert page.locator(".track svg").count() == 0
        assert value(page, "bonds.critical_speed") == "10 mm/s"


def test_the_order_of_subtraction_is_in_the_sentence_with_both_its_ends(shown):
    idle(shown)
    words = lost(shown)
    curves = shown.evaluate("explored.answers.curves.answer")
    (at,) = curves["level"]["places"]
    scene = sim.load(tomllib.loads(SCENE))
    exact = steady(scene, np.array([at]))
    for name, either in (
        ("bonds", ("lost_to_bonds", "lost_to_bonds_last")),
        ("fluctuations", ("lost_to_fluctuations", "lost_to_fluctuations_first")),
    ):
        ends = sorted(100.0 * float(exact[k][0]) for k in either)
        assert f"{name} {ends[0]:.1f} to {ends[1]:.1f}" in words
    shown.locator("#first").check()
    idle(shown)
    assert lost(shown) == words


def test_the_flagship_of_stick_slip_opens_with_slips_that_go_on_under_a_new_number(
    browser,
):
    with scenario(browser, "pdms_lens_spring") as page:
        wait(page, lambda: lost(page).startswith("First member, 2 s"), "no motion")
        forces = page.evaluate("explored.motion.columns.spring_force")
        assert len(forces) == 2001 and max(forces) > 3.0 * min(forces)
        first = sim.run(
            sim.load(
                "scenarios/pdms_lens_spring.toml", {"sweep": {}, "ensemble.members": 1}
            )
        )
        assert_allclose(forces, first["spring_force"][..., :].squeeze(), rtol=1e-5)
        assert page.locator("[id='drive.stage']").count()
        wait(page, lambda: page.evaluate("explored.motion.time > 0.05"), "it stands")
        words = page.locator("#ratio").text_content
        wait(page, lambda: words().startswith("now 1 : "), "no ratio")
        page.locator("#play").click()
        time = page.evaluate("explored.motion.time")
        enter(page, "8 mN", LOAD)
        wait(page, lambda: "changed at" in lost(page), "the motion stays")
        idle(page)
        pieces = page.evaluate("explored.motion.pieces")
        assert [piece["of"][LOAD] for piece in pieces] == [4e-3, 8e-3]
        assert time <= pieces[1]["from"] <= time + 0.0201
        after = page.evaluate("explored.motion.columns.spring_force")
        cut = round(pieces[1]["from"] / 1e-3) + 1
        assert after[:cut] == forces[:cut] and after[cut:] != forces[cut:]
        assert page.locator("#plot [data-name=changed]").count()


def test_a_click_on_the_map_of_stability_plays_that_point(browser):
    with scenario(browser, "stability_map") as page:
        page.wait_for_selector("#plot [data-name='V grows 0 20']")
        softest = page.evaluate("explored.start.points[0]['drive.stiffness']")
        page.evaluate(
            """document.querySelector("[data-name='V grows 0 20']")
            .dispatchEvent(new MouseEvent("click", { bubbles: true }))"""
        )
        motion = (
            "explored.view.figure === 'motion' && explored.motion.columns.t.length > 1"
        )
        wait(page, lambda: page.evaluate(motion), "no motion")
        assert page.evaluate("explored.values['drive.stiffness']") == softest
        # the stage has the speed of the cell after 20 of 24 equal factors within 4 s
        time = page.evaluate("explored.motion.time")
        moment = page.locator("#moment")
        wait(page, lambda: "map has set" in moment.text_content(), "no word")
        assert 4.0 * 20.0 / 24.0 - 0.01 < time < 4.0 * 21.0 / 24.0
        page.locator("#undo").click()
        assert page.evaluate("explored.values['drive.stiffness']") == 100.0
        assert page.evaluate("explored.view.figure") == "map"


def test_a_long_trace_shows_all_slips(browser):
    with scenario(browser, "stability_map", reduced_motion="reduce") as page:
        page.get_by_label("the motion", exact=True).check()
        wait(page, lambda: lost(page).startswith("First member, 8 s"), "no motion")
        idle(page)
        forces = np.array(page.evaluate("explored.motion.columns.spring_force"))
        path = page.locator("#plot [data-name=spring_force]").get_attribute("d")
        points = np.array(re.findall(r"([\d.]+) ([\d.]+)", path), float)
        # least and largest force of each column of pixels, from the records
        axis = (points[:, 0].min(), points[:, 0].max())
        x = np.interp(np.arange(len(forces)), [0, len(forces) - 1], axis)
        top, bottom = points[:, 1].min(), points[:, 1].max()
        up = np.interp(forces, [forces.min(), forces.max()], [bottom, top])
        for column in range(int(axis[0]) + 1, int(axis[1])):
            here = up[np.floor(x) == column]
            # places and heights of the path have one decimal
            near = np.abs(points[:, 0] - column - 0.5) <= 0.56
            seen = points[near, 1]
            assert seen.max() >= here.max() - 0.1 and seen.min() <= here.min() + 0.1


def test_a_share_lost_at_every_speed_and_an_open_contact_are_said(browser):
    with scenario(browser, "own_map") as page:
        page.get_by_label("over the sliding speed").check()
        idle(page)
        curves = page.evaluate("explored.answers.curves.answer.curves")
        least = 100.0 * (1.0 - max(curves["area_ratio"]))
        assert least > 10.0
        assert f"at every speed shown: {least:.3g}" in lost(page)
    with scenario(browser, "afm_tip") as page:
        idle(page)
        assert "open" not in lost(page)
        enter(page, "-1 uN", LOAD)  # beyond the pull-off of any range
        page.get_by_label("over the sliding speed").check()
        idle(page)
        assert "contact is open" in lost(page)


def test_stars_mark_the_numbers_that_change_the_drawn_share_most(browser):
    with scenario(browser, "pdms_lens") as page:
        idle(page)
        marked = page.evaluate(
            """[...document.querySelectorAll(".slider label")]
            .filter((label) => label.textContent.startsWith("★")).map((label) => label.htmlFor)"""
        )
    scene = sim.load("scenarios/pdms_lens.toml").with_values({})
    speeds = Page(scene).speeds
    before, effects = steady(scene, speeds)["area_ratio"], {}
    for key in (*marked, RADIUS, "solid.poisson_ratio", "adhesion.work"):
        number, effects[key] = quantities(scene)[key][1], 0.0
        for change in (-0.1, 0.1):
            with contextlib.suppress(sim.BadInput):  # beyond the bound of a share
                other = scene.with_values({key: number + change * (number or 1.0)})
                off = steady(other, speeds)["area_ratio"] - before
                effects[key] = max(effects[key], np.max(np.abs(off)))
    assert len(marked) == 3 and RADIUS not in marked
    assert min(effects[key] for key in marked) >= max(
        effect for key, effect in effects.items() if key not in marked
    )


def test_a_band_that_was_slow_follows_later_moves_again(random):
    idle(random)
    assert random.locator("#plot [data-name=own]").count()
    slow = {"reason": "eight members take too long to follow the sliders"}
    random.route("**/band", lambda route: route.fulfill(json=slow))
    enter(random, "8 mN", LOAD)
    wait(random, lambda: "too long" in random.locator("#ran").text_content(), "no word")
    assert not random.locator("#plot [data-name=own]").count()
    random.unroute("**/band")
    enter(random, "6 mN", LOAD)
    idle(random)
    assert random.locator("#plot [data-name=own]").count()
    assert "too long" not in random.locator("#ran").text_content()


def test_the_page_follows_the_file_and_writes_back_after_it_shows_the_difference(
    browser, lens
):
    with explored(lens) as (_, address), opened(browser, address) as page:
        enter(page, "3 mm")
        idle(page)
        page.locator("#save summary").click()
        page.get_by_text("write back").click()
        shown = page.locator("#change pre")
        wait(page, lambda: '+radius = "3 mm"' in shown.text_content(), "no difference")
        assert 'radius = "2 mm"' in lens.read_text(encoding="utf-8")
        page.locator("#cancel").click()
        assert not page.locator("#change").is_visible()
        page.locator("#save [data-kind=difference]").click()
        page.locator("#write").click()
        wait(page, lambda: RADIUS not in page.url, "the file has another number")
        settled(page)
        idle(page)
        assert 'radius = "3 mm"' in lens.read_text(encoding="utf-8")
        assert value(page) == "3 mm" and page.locator("#reset").is_disabled()
        # a file that is saved by another program is shown, one with a fault is named
        text = lens.read_text(encoding="utf-8").replace('"3 mm"', '"4 mm"')
        lens.write_text(text, encoding="utf-8")
        wait(page, lambda: value(page) == "4 mm", "the page does not follow")
        settled(page)
        lens.write_text(text.replace('"4 mm"', '"4 kg"'), encoding="utf-8")
        trouble = page.locator("#trouble")
        wait(page, lambda: "kg" in trouble.text_content(), "the fault is not named")
        assert value(page) == "4 mm"


def test_a_fit_has_a_band_over_residuals_and_the_last_run_a_paragraph(browser):
    looks = {"permissions": ["clipboard-read", "clipboard-write"]}
    with scenario(browser, "measured_lens", **looks) as page:
        idle(page)
        assert "tick the numbers" in lost(page)
        for key in ("bonds.critical_speed", "bonds.stress"):
            page.locator(f"#free input[value='{key}']").check()
        page.locator("#fit").click()
        wait(page, lambda: page.locator("#fitted").is_visible(), "no fit")
        idle(page)
        assert "tick the numbers" not in lost(page)
        assert page.locator("#plot [data-name=draws]").count() == 2
        assert page.locator("#plot [data-name=residual]").count() == 20
        enter(page, "3 mm")
        idle(page)
        assert page.locator("#plot [data-name=draws]").count() == 0
        page.locator("#copy summary").click()
        page.locator("#copy [data-what=methods]").click()
        wait(
            page, lambda: "first" in page.locator("#trouble").text_content(), "no word"
        )
        page.locator("#run").click()
        wait(page, lambda: page.evaluate("explored.run !== null"), "no run")
        page.locator("#copy [data-what=methods]").click()
        wait(page, lambda: page.locator("#copied").text_content(), "not copied")
        text = page.evaluate("navigator.clipboard.readText()")
        assert "sphere" in text and "@" in text and "3 mm" in text


def test_a_slider_beyond_its_partner_is_undone_whole(browser):
    key = "shear.spectrum.shortest"
    with scenario(browser, "pdms_lens") as page:
        idle(page)
        before = value(page, key)
        slider = page.locator(f"[id='{key}']")
        slider.evaluate(
            """(item) => { for (const place of [200, 290, 300]) {
            item.value = place; item.dispatchEvent(new Event("input", { bubbles: true })); }
            item.dispatchEvent(new Event("change", { bubbles: true })); }"""
        )
        wait(page, lambda: page.locator(ALERT).count() == 1, "not refused")
        idle(page)
        message = page.locator(ALERT).text_content()
        assert "30 µm" in message and f"{value(page, key)} stays in use" in message
        if page.locator("#undo").is_enabled():
            page.locator("#undo").click()
        idle(page)
        assert value(page, key) == before
        enter(page, "abc", key)
        wait(page, lambda: "abc" in page.locator(ALERT).text_content(), "not refused")
        described = page.locator(f"[id='text {key}']").get_attribute(
            "aria-errormessage"
        )
        assert "abc" in page.locator(f"[id='{described}']").text_content()
        page.locator("#reset").click()
        idle(page)
        assert value(page, key) == before and page.locator(ALERT).count() == 0


def test_one_bad_number_of_an_address_is_named_and_left_out(browser, served):
    with opened(browser, f"{served}&{RADIUS}=-1&contact.load=0.008") as page:
        idle(page)
        assert (value(page), value(page, LOAD)) == ("2 mm", "8 mN")
        assert "above 0" in page.locator("#trouble").text_content()


def test_a_saved_figure_is_the_one_that_is_seen(random):
    drop(random, "speed [mm/s],contact_area [mm^2]\n1,0.04\n9,0.03", "own.csv")
    run(random, 8)
    random.locator("#absolute").check()
    wait(random, lambda: "8 members" in random.locator("#ran").text_content(), "no run")
    idle(random)
    text = saved(random, "svg").read_text(encoding="utf-8")
    for word in ("measured", "mean of 8 members", "area A (mm²)", "<desc"):
        assert word in text
    drawn = random.locator("#plot [data-name=area]").get_attribute("d")
    assert f'd="{drawn}"' in text


def test_save_and_copy_are_played_by_keyboard(browser, served):
    with opened(
        browser, served, permissions=["clipboard-read", "clipboard-write"]
    ) as page:
        page.locator("#save summary").focus()
        page.keyboard.press("Enter")
        for _ in range(3):
            page.keyboard.press("Tab")
        with page.expect_download() as download:
            page.keyboard.press("Enter")
        assert download.value.suggested_filename == "explored.png"
        page.locator("#save summary").focus()
        page.keyboard.press("Enter")
        page.keyboard.press("Escape")
        assert page.evaluate("document.activeElement.textContent") == "Save"
        enter(page, "3 mm")
        wait(page, lambda: RADIUS in page.url, "not read")
        page.locator("#copy summary").click()
        page.get_by_text("link for this machine").click()
        wait(page, lambda: page.locator("#copied").text_content(), "not copied")
        link = page.evaluate("navigator.clipboard.readText()")
        page.locator("#copy summary").click()
        page.get_by_text("command", exact=True).click()
        page.wait_for_timeout(200)
        command = page.evaluate("navigator.clipboard.readText()")
        assert command.startswith("sim explore ") and f"{RADIUS}=0.003" in command
        with opened(browser, link) as other:
            assert value(other) == "3 mm"
        keyless = page.context.new_page()
        keyless.goto(served.partition("#")[0])
        wait(
            keyless,
            lambda: "lost its key" in keyless.locator("#trouble").text_content(),
            "no word",
        )
        assert not keyless.locator("#main").is_visible()


def test_a_text_that_is_being_written_stays_while_the_page_is_drawn(shown):
    idle(shown)
    field = shown.locator(f"[id='text {RADIUS}']")
    for text in ("3", "3 kg", "4"):  # a refusal does not stand in the way of the next
        field.fill(text)
        for _ in range(2):
            shown.evaluate("dispatchEvent(new Event('resize'))")
        assert field.input_value() == text
        field.press("Enter")
        idle(shown)
    assert field.input_value() == "4 mm"


def test_a_pinned_state_stays_beside_the_present_one_with_what_differs(shown):
    idle(shown)
    words = lost(shown)
    drawn = shown.locator("#plot [data-name=area]").get_attribute("d")
    shown.locator("#pin").click()
    enter(shown, "8 mN", LOAD)
    wait(shown, lambda: lost(shown) != words, "not read")
    idle(shown)
    assert shown.locator("#pinned").text_content() == f"Pinned at P = 4 mN: {words}"
    # shares of the area have one axis, so that the pinned curve is where it was
    pinned = shown.locator("#plot [data-name=pinned]").first.get_attribute("d")
    assert pinned == drawn != shown.locator("#plot [data-name=area]").get_attribute("d")
    shown.locator("#pin").click()
    idle(shown)
    assert not shown.locator("#pinned").is_visible()
    assert shown.locator("#plot [data-name=pinned]").count() == 0


def test_a_bare_number_has_the_unit_that_is_shown_and_a_mechanism_a_switch(shown):
    enter(shown, "5")
    wait(shown, lambda: value(shown) == "5 mm", "not read")
    enter(shown, "2,5")
    wait(shown, lambda: value(shown) == "2.5 mm", "no decimal comma")
    shown.get_by_label("fluctuations", exact=True).uncheck()
    idle(shown)
    assert shown.evaluate("explored.values['shear.paid_by_adhesion']") == 0
    assert shown.locator("#plot [data-name=lost_to_fluctuations]").count() == 0
    shown.keyboard.press("Control+z")
    idle(shown)
    assert shown.get_by_label("fluctuations", exact=True).is_checked()
    shown.keyboard.press("Control+Shift+Z")
    idle(shown)
    assert not shown.get_by_label("fluctuations", exact=True).is_checked()


def test_a_table_without_units_beyond_the_speeds_and_of_radii_is_drawn_and_said(shown):
    drop(shown, "speed,contact_radius\n1,1.1e-4\n2,1e-4", "radii.csv")
    wait(shown, lambda: "SI" in shown.locator("#judged").text_content(), "no remark")
    idle(shown)
    assert shown.locator("#plot [data-name=measured]").count() == 2
    assert shown.evaluate("explored.answers.curves.answer.x.at(-1)") >= 2.0


def test_curves_are_read_by_keyboard_and_as_a_table(shown):
    idle(shown)
    shown.locator("#at").focus()
    shown.keyboard.press("ArrowRight")
    reading = shown.locator("#reading")
    wait(shown, lambda: "area" in reading.text_content(), "no reading")
    place = int(shown.locator("#at").input_value())
    curves = shown.evaluate("explored.answers.curves.answer.curves")
    exact = 100.0 * curves["area_ratio"][place]
    # a value has its name and its unit, and stands below the line in the figure
    assert f" · area {exact:.4g} % of JKR's" in reading.text_content()
    at, rule = shown.locator("#at"), shown.locator("#plot [data-name=reading]").first
    for place in (0, 60, 120):
        at.evaluate(
            """(item, place) => { item.value = place;
            item.dispatchEvent(new Event("input", { bubbles: true })); }""",
            place,
        )
        idle(shown)
        box = at.bounding_box()
        line = rule.evaluate("(item) => item.getBoundingClientRect().left")
        # the thumb is 16 px wide; lines are drawn to a tenth of a pixel
        thumb = box["x"] + 8.0 + (box["width"] - 16.0) * place / 120.0
        assert abs(thumb - line) < 1.0
    assert reading.get_attribute("aria-live") == "polite"
    assert shown.locator("#plot svg title").text_content()
    shown.locator("#numbers summary").click()
    wait(shown, lambda: shown.locator("#numbers tr").count() > 50, "no table")


def test_a_move_keeps_the_elements_of_the_figure_and_changes_no_other_slider(shown):
    idle(shown)
    drawn = shown.locator("#plot [data-name=area]").get_attribute("d")
    shown.evaluate(
        """() => {
            const all = (where) => [...document.querySelectorAll(where)];
            window.figureBefore = all("#plot svg, #plot text, #plot [data-name=area]");
            window.changed = new Set();
            new MutationObserver((changes) => changes.forEach(({ target }) => {
                const slider = (target.closest ? target : target.parentElement)?.closest(".slider");
                if (slider) changed.add(slider.querySelector("[type=range]").id);
            })).observe(document.getElementById("groups"), {
                subtree: true, childList: true, attributes: true, characterData: true });
        }"""
    )
    enter(shown, "2.2 mm")
    wait(shown, lambda: value(shown) == "2.2 mm", "not read")
    idle(shown)
    assert shown.locator("#plot [data-name=area]").get_attribute("d") != drawn
    kept = (
        "[figureBefore.length, figureBefore.filter((item) => item.isConnected).length]"
    )
    before, after = shown.evaluate(kept)
    assert before > 20 and after == before
    assert shown.evaluate("[...changed]") == [RADIUS]


AXE = Path(sim.__file__).parents[1] / "node_modules" / "axe-core" / "axe.min.js"


@pytest.mark.skipif(not AXE.exists(), reason="make page installs axe-core")
@pytest.mark.parametrize(
    "name",
    ["pdms_lens", "pdms_lens_spring", "masking", "measured_lens", "stability_map"],
)
@pytest.mark.parametrize(
    "looks", [{}, {"color_scheme": "dark"}, {"viewport": {"width": 390, "height": 800}}]
)
def test_axe_finds_no_violation(browser, name, looks):
    with scenario(browser, name, **looks) as page:
        idle(page)
        page.locator("#numbers summary").click()
        page.evaluate(AXE.read_text(encoding="utf-8"))
        found = page.evaluate("axe.run().then(({ violations }) => violations)")
        assert [
            (one["id"], [node["html"][:200] for node in one["nodes"]]) for one in found
        ] == []


def test_reduced_motion_shows_pictures_at_steps(browser):
    with scenario(browser, "stick_slip", reduced_motion="reduce") as page:
        idle(page)
        page.wait_for_timeout(300)
        assert page.evaluate("explored.motion.time") == 0
        page.locator("#step").click()
        assert_allclose(page.evaluate("explored.motion.time"), 0.2, rtol=1e-9)


#: Facts of a page: its state, and what its controls, its figure and its sentence show.
FACTS = """async () => {
    const { textOf, placeOf, words } = await import("/state.js");
    const { ask } = await import("/connection.js");
    const frame = () => new Promise(requestAnimationFrame);
    let state = null;
    while (state !== explored) { state = explored; await frame(); await frame(); }
    if (!await (IDLE)()) return null; // a job has just ended
    const { start, values, view, run, fit, refusal, past, future, table } = state;
    const at = (id) => document.getElementById(id);
    const plot = at("plot");
    const fields = start.sliders.filter((slider) => {
        const [range, text] = [at(slider.key), at(`text ${slider.key}`)];
        const shown = refusal?.key === slider.key && refusal.typed ? refusal.text : textOf(explored, slider);
        const place = Math.min(300, Math.max(0, placeOf(slider, values[slider.key], 300)));
        return text.value !== shown || Number(range.value) !== place
            || (text.getAttribute("aria-invalid") === "true") !== (refusal?.key === slider.key);
    }).map(({ key }) => [key, at(key).value, at(`text ${key}`).value, values[key], JSON.stringify(refusal)]);
    const bars = document.querySelectorAll(".track svg").length;
    const isOf = (one) => one && Object.keys(one).every((key) => one[key] === values[key]);
    const facts = {
        values, view, fields, bars, table, x: explored.answers.curves.answer.x,
        // which is written at the end of a drag
        address: explored.dragging || location.hash.slice(1) === new URLSearchParams(words(explored)).toString(),
        drawn: JSON.parse(plot.dataset.of), share: Number(plot.dataset.share), lost: at("lost").textContent,
        reading: at("at").getAttribute("aria-valuetext"), place: Number(at("at").value),
        points: plot.querySelectorAll("[data-name=measured]").length,
        judged: at("judged").hidden ? "" : at("judged").textContent,
        stale: plot.querySelectorAll("[data-name=ran]").length,
        ran: run !== null, isRunOf: Boolean(run && isOf(run.of.values)),
        isFitOf: Boolean(fit && isOf({ ...fit.of.values, ...fit.values }) && fit.of.data === table),
        fitted: fit ? Object.keys(fit.values).length : 0,
        undo: !at("undo").disabled === past.length > 0, redo: !at("redo").disabled === future.length > 0,
        boxes: ["absolute", "first", "loads"].every((name) => at(name).checked === view[name]),
        level: Number(at("level").value) === Math.round(100 * view.share),
        switches: [...document.querySelectorAll("#mechanisms input")].every(
            (box) => box.checked === (values[box.value] !== 0)),
    };
    return { ...facts, toml: (await ask("toml", { values })).text };
}"""
#: Drags a slider over some places, without its end, or to its end.
DRAG = """(item, [places, isEnd]) => {
    item.dispatchEvent(new PointerEvent("pointerdown", { bubbles: true }));
    for (const place of places) {
        item.value = place;
        item.dispatchEvent(new Event("input", { bubbles: true }));
    }
    if (isEnd) item.dispatchEvent(new Event("change", { bubbles: true }));
}"""
KEYS = (RADIUS, LOAD, "bonds.critical_speed", "adhesion.work", "contact.reversible")


class Walk:
    """A random walk over the gestures of a page; each is followed by a look at all that it shows."""

    def __init__(self, page, path, seed):
        self.page, self.pick = page, np.random.default_rng(seed)
        self.model, self.path = Page(sim.load(path)), path
        self.table, self.done = None, []

    def gesture(self):
        kinds = [name for name in dir(self) if name.startswith("go_")]
        kinds += ["go_drag", "go_press", "go_text", "go_undo", "go_redo"] * 3
        name = str(self.pick.choice(kinds))
        self.done.append(name)
        getattr(self, name)()

    def key(self):
        return str(self.pick.choice(KEYS))

    def go_drag(self):
        places = self.pick.integers(0, 301, 5).tolist()
        slider = self.page.locator(f"[id='{self.key()}']")
        slider.evaluate(DRAG, [places, bool(self.pick.random() < 0.8)])

    def go_press(self):
        self.page.locator(f"[id='{self.key()}']").focus()
        for _ in range(self.pick.integers(1, 4)):
            self.page.keyboard.press(
                str(self.pick.choice(["ArrowLeft", "ArrowRight", "End"]))
            )

    def go_text(self):
        texts = ["3 kg", "abc", "2", "3,5", "-1", "1e-3", "2 mm", "8 mN", "7 mm/s", ""]
        enter(self.page, str(self.pick.choice(texts)), self.key())

    def go_undo(self):
        self.page.evaluate("document.getElementById('undo').click()")

    def go_redo(self):
        self.page.keyboard.press("Control+y")

    def go_reset(self):
        self.page.evaluate("document.getElementById('reset').click()")

    def go_view(self):
        name = str(self.pick.choice(["absolute", "first", "loads"]))
        # one of them is shown only if two mechanisms act
        self.page.evaluate(f"document.getElementById('{name}').click()")

    def go_level(self):
        place = int(self.pick.integers(1, 96))
        self.page.locator("#level").evaluate(DRAG, [[place], True])

    def go_switch(self):
        boxes = self.page.locator("#mechanisms input")
        boxes.nth(int(self.pick.integers(0, boxes.count()))).click()

    def go_run(self):
        run(self.page, int(self.pick.integers(2, 5)))

    def go_stop(self):
        self.page.evaluate("document.getElementById('stop').click()")

    def go_table(self):
        drop(self.page, points(self.path, [1e-3, 3e-3, 1e-2]), "own.csv")

    def go_fit(self):
        box = self.page.locator("#free input[value='bonds.critical_speed']")
        if box.is_visible():
            box.check()
            self.page.evaluate("document.getElementById('fit').click()")

    def go_use(self):
        if self.page.locator("#use").is_visible():
            self.page.locator("#use").click()

    def go_link(self):
        word = str(self.pick.choice(["0.003", "0.001", "abc", "-1"]))
        self.page.evaluate(f"location.hash = '{self.key()}={word}&share=0.2'")

    def go_reload(self):
        self.page.reload()
        settled(self.page)

    def look(self):
        """Assert that fields, state, saved scenario, figure and sentence are of the same numbers."""
        idle(self.page)
        facts = None
        while facts is None:
            facts = self.page.evaluate(FACTS.replace("IDLE", IDLE))
        values, share = facts["values"], facts["view"]["share"]
        assert facts["fields"] == []
        assert facts["drawn"] == values and facts["share"] == share
        for name in ("address", "undo", "redo", "boxes", "level", "switches"):
            assert facts[name], name
        known = quantities(sim.load(tomllib.loads(facts["toml"])))
        for key, number in values.items():
            assert_allclose(known[key][1], number, rtol=1e-12, err_msg=key)
        columns = steady(self.model.read(values), np.array(facts["x"]))
        name = "contact_area" if facts["view"]["absolute"] else "area_ratio"
        exact = float(columns[name][facts["place"]])
        shown = re.search(r"; area (\S+) ([^;]+)", facts["reading"])
        factor = {"% of JKR's": 100.0, "m²": 1.0, "mm²": 1e6, "µm²": 1e12}[shown[2]]
        if math.isfinite(exact):
            assert_allclose(
                float(shown[1].replace("−", "-")), factor * exact, rtol=1e-3
            )
        # a table may have widened the axis
        if facts["x"][-1] < 1.1 * self.model.speeds[-1]:
            words = self.model.answer(values, share)["level"]["words"]
            assert facts["lost"] == words
        has_table = facts["table"] is not None
        assert has_table == ("χ²" in facts["judged"])
        # an open contact has no share of JKR's area
        assert (facts["points"] > 0) == (has_table and math.isfinite(exact))
        assert (facts["stale"] > 0) == (facts["ran"] and not facts["isRunOf"])
        assert facts["bars"] == (facts["fitted"] if facts["isFitOf"] else 0)


@contextlib.contextmanager
def opened_in(engine, request, address):
    """A page in Chromium, or in Firefox by a driver of our own."""
    if engine == "chromium":
        with opened(request.getfixturevalue("browser"), address) as page:
            yield page
        return
    if not FIREFOX:
        pytest.skip("no Firefox")
    with firefox(FIREFOX) as page:
        page.goto(address)
        settled(page)
        yield page


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("engine", ["chromium", "firefox"])
def test_after_any_gesture_all_that_is_shown_belongs_to_the_same_numbers(
    request, tmp_path, engine, seed
):
    path = tmp_path / "random.toml"
    path.write_text(LENS + RAMP + COUNTED + WAVES, encoding="utf-8")
    with (
        explored(path) as (_, address),
        opened_in(engine, request, address) as page,
    ):
        walk = Walk(page, path, seed)
        for _ in range(GESTURES):
            walk.gesture()
            try:
                walk.look()
            except AssertionError as fault:
                raise AssertionError(f"after {walk.done[-6:]}: {fault}") from fault
        assert page.said == []


def test_a_notebook_shows_pages_side_by_side_that_end_with_its_kernel(
    tmp_path, browser
):
    nbclient, nbformat = (
        pytest.importorskip(name, reason="in the extra verify")
        for name in ("nbclient", "nbformat")
    )
    scene = tomllib.loads(LENS + RAMP + BONDS)
    code = f"import json, sim\nscene = sim.load(json.loads({json.dumps(json.dumps(scene))}))\n"
    code += "pages = [sim.explore(scene) for _ in range(3)]\nprint(*[page.address for page in pages])\npages[0]"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    client = nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3")
    with client.setup_kernel():
        client.execute_cell(notebook.cells[0], 0)
        printed, result = notebook.cells[0]["outputs"]
        assert (
            "<iframe" in result["data"]["text/html"]
            and "ssh -L" in result["data"]["text/html"]
        )
        addresses = printed["text"].split()
        assert len({*addresses}) == 3
        for address in addresses:
            with opened(browser, address) as page:
                assert lost(page).startswith("10 %")
    with (
        pytest.raises(playwright.Error, match="ERR_CONNECTION_REFUSED"),
        opened(browser, addresses[0]),
    ):
        pass

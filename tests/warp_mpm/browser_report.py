"""Report and live page in a real browser: no complaints on the console, buttons do what they say, the pointer finds
values.

Not collected by default: `make test-browser` runs it. Needs Playwright and Chromium (Debian's package `chromium`, or
its path in CHROMIUM).
"""

import os
import shutil
import threading

import pytest

from warp_mpm.live import LivePage
from warp_mpm.report import write_report
from warp_mpm.results import Results
from warp_mpm.run import run_scenario

QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    assert path, "no Chromium here: install Debian's package chromium, or set CHROMIUM to its path"
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=path, args=list(QUIET))
        yield running
        running.close()


@pytest.fixture
def page(browser, tmp_path, load_scene, flying_points):
    runs = []
    for name in ("case_1", "case_1_fixed"):
        scene = load_scene(name, **{"numerics.spacing_m": 0.5, "output.end_time_s": 3.0})
        run_scenario(scene, tmp_path / name, make_simulation=flying_points)
        runs.append(Results.open(tmp_path / name))
    write_report(runs, tmp_path / "report.html")
    complaints = []
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: complaints.append(request.url) if request.url.startswith("http") else None)
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_selector("body[data-ready=yes]", timeout=20_000)
    yield page
    assert complaints == []
    page.close()


def picture(page):
    return page.evaluate("document.querySelector('canvas.viewer').toDataURL()")


def test_play_plays_and_pauses(page):
    before, start = picture(page), page.evaluate("report.time")
    page.click("#play")
    page.wait_for_function(f"report.time > {start + 0.3}", timeout=10_000)
    page.click("#play")
    stopped = page.evaluate("report.time")
    assert picture(page) != before
    page.wait_for_timeout(200)
    assert page.evaluate("report.time") == stopped


def test_scrubbing_colours_and_views_change_the_picture(page):
    seen = {picture(page)}
    page.evaluate("const s = document.getElementById('scrub'); s.value = 700; s.dispatchEvent(new Event('input'))")
    assert page.evaluate("report.time") == pytest.approx(0.7 * 3.0)
    seen.add(picture(page))
    for field in ("speed", "volumetric_strain", "mean_effective_stress"):
        page.select_option("#field", field)
        seen.add(picture(page))
    page.click("#whole")
    seen.add(picture(page))
    assert len(seen) >= 4  # the stand-in's volumes never change, so two colourings may look alike


def test_pointer_on_the_material_shows_its_values(page):
    page.evaluate("const s = document.getElementById('scrub'); s.value = 0; s.dispatchEvent(new Event('input'))")
    page.locator("canvas.viewer").first.scroll_into_view_if_needed()
    box = page.locator("canvas.viewer").first.bounding_box()
    found = set()
    for down in range(2, 100, 4):
        page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + box["height"] * down / 100)
        found.add(page.locator(".tip").text_content() if page.locator(".tip").is_visible() else "")
    assert "" in found  # nothing where there is no material
    assert any("pore pressure" in words and "kPa" in words for words in found)


def test_every_section_is_filled(page):
    assert page.locator("canvas.viewer").count() == 2
    assert page.locator("#charts .chart").count() >= 6
    assert page.locator("canvas.still").count() == 6  # two runs, each at a sixth, a third and two thirds of it
    for table in ("figure-table", "ledger-table", "settings-table", "versions-table"):
        assert page.locator(f"#{table} tr").count() > 3
    assert page.locator("#problem").is_hidden()


# -- the live page -----------------------------------------------------------------------------------------------------


def until(page, expression):
    """Wait; `wait_for_function` would need what the page's policy forbids."""
    for _ in range(200):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"never: {expression}")


@pytest.fixture(params=["light", "dark"])
def live(browser, tmp_path, load_scene, flying_points, request):
    """A run that goes on until it is let go or stopped, and a browser that looks at it."""
    scene = load_scene("case_1", **{"numerics.spacing_m": 0.5, "output.end_time_s": 300.0})
    scene = scene.replaced({"output.time_series_interval_s": 0.1, "output.checkpoint_interval_s": 1000.0})
    outcomes = []
    complaints = []
    with LivePage(scene, tmp_path / "run") as server:

        def run():
            slowly = threading.Event()
            watching = server.watching(lambda progress: slowly.wait(0.05), lambda: False)
            outcomes.append(run_scenario(scene, tmp_path / "run", make_simulation=flying_points, **watching))
            server.end(outcomes[0].finished)

        page = browser.new_page(viewport={"width": 1200, "height": 900}, color_scheme=request.param)
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        runner = threading.Thread(target=run)
        page.goto(server.address)
        page.wait_for_selector("body[data-ready=yes]", timeout=20_000)
        assert page.locator("#status").text_content().startswith("preparing")
        runner.start()
        until(page, "live.frame > 1 && live.samples.length > 5")
        yield page, outcomes
        server.ask("stop")
        runner.join()
    assert complaints == []
    page.close()


def test_the_live_page_shows_the_run_and_stops_it(live):
    page, outcomes = live
    before, samples = (
        page.evaluate("document.getElementById('points').toDataURL()"),
        page.evaluate("live.samples.length"),
    )
    until(page, f"live.frame > 3 && live.samples.length > {samples + 5}")
    assert page.evaluate("document.getElementById('points').toDataURL()") != before
    assert page.locator("#charts .chart path").count() == 3
    assert page.locator("#left").text_content().endswith("min left")
    page.select_option("#field", "speed")
    assert "speed" in page.locator("#points").get_attribute("aria-label")
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")

    page.keyboard.press("Tab")
    page.focus("#keep")
    page.keyboard.press("Enter")
    until(page, "document.getElementById('said').textContent.startsWith('Kept at t =')")

    page.focus("#stop")
    page.keyboard.press("Enter")
    page.keyboard.press("Escape")  # changed one's mind
    page.wait_for_timeout(700)
    assert page.locator("#stop").is_enabled()
    page.focus("#stop")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    until(page, "document.getElementById('status').textContent === 'stopped'")
    assert [outcome.finished for outcome in outcomes] == [False]
    assert page.locator("#stop").is_disabled()


def test_the_live_page_fits_a_telephone(live):
    page, _ = live
    page.set_viewport_size({"width": 380, "height": 700})
    page.wait_for_timeout(700)
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    for button in ("#keep", "#stop"):
        assert page.locator(button).bounding_box()["height"] >= 24

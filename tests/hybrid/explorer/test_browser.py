"""The page in a browser without a display."""

import os
import shutil
import time

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import hybrid
import models

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = shutil.which("chromedriver")
MISSING = "Chromium and chromedriver are not installed (Debian: apt-get install chromium chromium-driver)"

# The page is drawn by Bokeh: its document has the figures, sliders and sources.
TOOLS = """
const models = [...Bokeh.documents[0]._all_models.values()];
const figure = (name) => models.find((each) => each.name === name);
const points = () => figure("section").renderers
    .map((each) => each.data_source).find((each) => each.data && each.data.mode !== undefined);
const slider = (title) => models.find((each) => each.type === "Slider" && each.title.startsWith(title));
const all = (root, kind, found) => {
    found.push(...root.querySelectorAll(kind));
    for (const each of root.querySelectorAll("*")) if (each.shadowRoot) all(each.shadowRoot, kind, found);
    return found;
};
const button = (text) => all(document, "button", []).find((each) => each.textContent.trim() === text);
const script = () => all(document, "pre", []).map((each) => each.textContent)
    .find((each) => each.startsWith("import hybrid"));
"""


@pytest.fixture(scope="module", autouse=True)
def installed(request):
    """Without a browser the tests are skipped, or fail where ``--browser`` asks for them."""
    if not (CHROMIUM and DRIVER):
        (pytest.fail if request.config.getoption("browser") else pytest.skip)(MISSING)


@pytest.fixture(scope="module")
def explorer():
    made = hybrid.explore(models.vibroimpact(), ranges={"omega": (7.3, 8.0)}, block=False)
    yield made
    made.stop()


@pytest.fixture(scope="module")
def browser():
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for each in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1280,2000"):
        options.add_argument(each)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    made = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    made.set_script_timeout(60)
    yield made
    made.quit()


@pytest.fixture(scope="module")
def page(browser, explorer):
    """The page, loaded once: each test takes it as the test before has left it."""
    browser.get(explorer.url)
    wait(browser, "return points() && points().data.x0.length === 2000")
    return browser


def run(browser, code, *arguments):
    return browser.execute_script(TOOLS + code, *arguments)


def wait(browser, code, seconds=60.0):
    """Wait until JavaScript says true; what it says last is the answer."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            if found := run(browser, code):
                return found
        except Exception as error:  # the document is not there yet
            last = error
            time.sleep(0.1)
            continue
        last = None
        time.sleep(0.05)
    raise AssertionError(f"waited {seconds} s for: {code}; {last}")


def errors(browser):
    return [each["message"] for each in browser.get_log("browser") if each["level"] == "SEVERE"]


def test_it_loads_without_an_error(page):
    wait(
        page,
        "return figure('diagram').renderers.some((each) => each.data_source?.data.parameter?.length > 0)",
    )
    assert errors(page) == []
    assert page.title == "vibro-impact"
    assert_fits(page, 1280)


def assert_fits(page, width):
    """Nothing is cut off at this width."""
    if folder := os.environ.get("HYBRID_SCREENSHOTS"):
        time.sleep(8)
        page.save_screenshot(f"{folder}/explore_{width}.png")
    assert run(page, "return document.documentElement.scrollWidth") <= width + 1


def test_the_script_runs_and_gives_the_same_numbers(page):
    run(page, "button('Orbit near here').click()")
    text = wait(page, "const text = script(); return text && text.includes('orbit = ') ? text : null")
    shown = run(page, "return Array.from(points().data.x0)")
    made = {"system": models.vibroimpact()}
    exec(compile(text, "explored.py", "exec"), made)
    plt.close("all")
    np.testing.assert_array_equal(made["section"].x[:, 0], shown)
    multipliers = run(page, "return Array.from(figure('multipliers').renderers[1].data_source.data.re)")
    np.testing.assert_allclose(np.sort(made["orbit"].multipliers.real), np.sort(multipliers), rtol=1e-9)


def test_a_drag_changes_the_portrait(page, capsys):
    """The time from the drag to the redrawn picture is printed, not judged: the machine is shared."""
    drag = """
    const done = arguments[arguments.length - 1];
    const [from, to, count] = arguments;
    const source = points(), times = [];
    const next = (i) => {
        if (i === count) { done(times); return; }
        const begin = performance.now();
        const drawn = () => {
            source.properties.data.change.disconnect(drawn);
            requestAnimationFrame(() => setTimeout(() => {
                times.push(performance.now() - begin);
                setTimeout(() => next(i + 1), 50);
            }, 0));
        };
        source.properties.data.change.connect(drawn);
        slider("omega (").value = from + (to - from) * (i + 1) / count;
    };
    next(0);
    """
    before = run(page, "return Array.from(points().data.x0)")
    times = page.execute_async_script(TOOLS + drag, 7.4, 7.92, 15)
    after = run(page, "return Array.from(points().data.x0)")
    assert before != after
    with capsys.disabled():
        print(f"\nfrom drag to redrawn picture: median {np.median(times):.0f} ms, of {len(times)}", end=" ")
    expected = hybrid.stroboscopic_section(
        models.vibroimpact(), **start_of(page), parameters={"omega": 7.92}, periods=2000, transient=200
    )
    np.testing.assert_array_equal(after, expected.x[:, 0])
    assert errors(page) == []


def start_of(page):
    """The start that the script of the page names."""
    text = wait(page, "return script()")
    made = {}
    opening = text.partition("section = ")[2].partition("\n)")[0] + "\n)"
    call = opening.replace("hybrid.stroboscopic_section(", "dict(x0=")
    call = call.replace("x0=\n    system,\n    {", "x0={")
    exec(f"found = {call}", {}, made)
    return {"x0": made["found"]["x0"], "mode": made["found"]["mode"]}


def test_everything_is_reached_by_keyboard(page):
    """Each control is in the order of the tabulator, and an arrow moves a slider."""
    from selenium.webdriver.common.keys import Keys

    handle = run(page, "return all(document, '.noUi-handle', [])[0]")
    assert handle.get_attribute("tabindex") == "0"
    before = run(page, "return slider('omega (').value")
    handle.send_keys(Keys.ARROW_RIGHT)
    assert wait(page, f"return slider('omega (').value !== {before} && slider('omega (').value") > before
    focusable = run(
        page, "return all(document, 'button, input, select', []).filter((each) => each.tabIndex < 0).length"
    )
    assert focusable == 0


def test_a_click_starts_an_orbit(page):
    """In the middle of the portrait: the start moves there, and the section is that of the new start."""
    from selenium.webdriver.common.action_chains import ActionChains

    where = """
    const view = Bokeh.index.find_one_by_id ? Bokeh.index.find_one_by_id(figure("portrait").id) : null;
    const box = view.canvas_view.el.getBoundingClientRect(), inside = view.frame.bbox;
    return [box.x + inside.left + 0.5 * inside.width, box.y + inside.top + 0.4 * inside.height];
    """
    start = "return Array.from(figure('section').renderers.map((each) => each.data_source.data)[4].x0)"
    before = run(page, start)
    x, y = run(page, where)
    actions = ActionChains(page)
    actions.w3c_actions.pointer_action.move_to_location(round(x), round(y))
    actions.w3c_actions.pointer_action.click()
    actions.perform()
    end = time.monotonic() + 20
    while run(page, start) == before and time.monotonic() < end:
        time.sleep(0.05)
    assert run(page, start) != before
    assert errors(page) == []


def test_share_puts_the_scene_into_the_address(page):
    run(page, "slider('omega (').value = 7.5")
    wait(page, "return script() && script().includes(\"'omega': 7.5\")")
    run(page, "button('Share').click()")
    wait(page, "return document.location.search.startsWith('?p.omega=7.5')")
    # What cannot be read in an address is said; the rest holds.
    page.get(page.current_url + "&section=nonsense&level=%ff")
    wait(page, "return slider('omega (').value === 7.5")
    wait(page, "return all(document, '[role=status]', []).some((e) => e.textContent.includes('nonsense'))")


def test_nothing_is_cut_off_on_a_telephone(page):
    width = 390
    page.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 2000, "deviceScaleFactor": 1, "mobile": True},
    )
    page.refresh()
    wait(page, "return points() && points().data.x0.length === 2000")
    assert_fits(page, width)

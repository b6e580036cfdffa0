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


# Texts that the browser draws into the canvases of the figures, with the rectangles that they fill.
TEXTS = """
const done = arguments[arguments.length - 1];
const drawn = new Map(), context = CanvasRenderingContext2D.prototype;
const plain = context.fillText, clear = context.clearRect;
context.clearRect = function (...given) {
    drawn.delete(this.canvas);
    return clear.apply(this, given);
};
context.fillText = function (text, x, y, ...rest) {
    const size = this.measureText(text), at = this.getTransform();
    if (at.b === 0) {
        const corner = (dx, dy) => [at.a * (x + dx) + at.e, at.d * (y + dy) + at.f];
        const [left, top] = corner(-size.actualBoundingBoxLeft, -size.actualBoundingBoxAscent);
        const [right, bottom] = corner(size.actualBoundingBoxRight, size.actualBoundingBoxDescent);
        if (!drawn.has(this.canvas)) drawn.set(this.canvas, new Map());
        drawn.get(this.canvas).set(`${text} ${left} ${top}`, [text, left, top, right, bottom]);
    }
    return plain.call(this, text, x, y, ...rest);
};
for (const name of arguments[0]) Bokeh.index.find_one_by_id(figure(name).id).request_paint();
setTimeout(() => {
    context.fillText = plain;
    context.clearRect = clear;
    done([...drawn.values()].map((each) => [...each.values()]));
}, 500);
"""
BUTTONS = (
    *("Orbit near here", "Its branch", "Basins", "Hold to compare", "Reset", "Share"),
    *("Previous jump", "Play", "Next jump", "Save the picture", "Copy the script", "Save the script"),
)
FIGURES = ["portrait", "section", "series", "exponents", "diagram", "largest", "multipliers"]


def assert_texts_are_apart(page):
    """No label of an axis runs into another text of its figure, once all figures have their contents."""
    wait(page, "return models.some((each) => each.type.endsWith('Progress') && each.value === 100)", 120)
    figures = page.execute_async_script(TOOLS + TEXTS, FIGURES)
    assert len(figures) == len(FIGURES)
    for texts in figures:
        assert len(texts) > 4
        for i, (one, *a) in enumerate(texts):
            for other, *b in texts[i + 1 :]:
                meet = a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
                assert not meet, (one, other)


def resize(page, width, height, mobile=False):
    """Give the page a window of this size."""
    page.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile},
    )


def test_buttons_are_in_view_and_labels_apart_in_a_small_window(page):
    """Also when the page is scrolled: the bar of the buttons stays."""
    resize(page, 900, 900)
    places = """return all(document, "button, a.bk-btn", []).map((each) => {
        const box = each.getBoundingClientRect();
        return [each.textContent.trim(), box.left, box.top, box.right, box.bottom, box.width];
    })"""
    for scrolled in (0, 700):
        page.execute_script("window.scrollTo(0, arguments[0])", scrolled)
        time.sleep(0.2)
        found = {text: box for text, *box in run(page, places)}
        assert set(BUTTONS) <= set(found)
        for left, top, right, bottom, width in map(found.get, BUTTONS):
            assert width > 0
            assert min(left, top) >= 0
            assert max(right, bottom) <= 900
    assert page.execute_script("return window.scrollY") > 0
    page.execute_script("window.scrollTo(0, 0)")
    assert_fits(page, 900)
    assert_texts_are_apart(page)
    page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_one_cause_is_told_once_and_in_the_page(page):
    """A parameter that cannot be spoils all pictures, and the page says so in one sentence."""
    before = run(page, "return slider('omega (').value")
    run(page, "slider('omega (').value = 0.0")
    told = """return all(document, '[role=status]', []).map((each) => each.textContent)
        .filter((each) => each.includes('period must be finite'))"""
    wait(page, f"const told = (() => {{ {told} }})(); return told.some((each) => each.includes('exponents'))")
    assert len(run(page, told)) == 1
    assert run(page, told)[0].count("period must be finite") == 1
    assert run(page, "return Bokeh.documents[0].config.notify_connection_status") is False
    run(page, "slider('omega (').value = arguments[0]", before)
    wait(page, "return points().data.x0.length === 2000 && slider('omega (').value > 7")
    wait(page, f"return (() => {{ {told} }})().length === 0")


def test_a_picture_is_saved_under_the_name_of_the_model(page, tmp_path):
    page.execute_cdp_cmd("Page.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)})
    choose = """const select = all(document, "select", [])
        .find((each) => [...each.options].some((option) => option.text === "time series"));
    select.value = [...select.options].find((option) => option.text === "diagram").value;
    select.dispatchEvent(new Event("change"));"""
    run(page, choose)
    time.sleep(0.5)
    run(page, "button('Save the picture').click()")
    file, end = tmp_path / "vibro-impact_diagram.png", time.monotonic() + 30
    while not file.exists() and time.monotonic() < end:
        time.sleep(0.1)
    assert file.read_bytes()[:4] == b"\x89PNG"


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
    resize(page, width, 2000, mobile=True)
    page.refresh()
    wait(page, "return points() && points().data.x0.length === 2000")
    assert_fits(page, width)
    assert_texts_are_apart(page)


def test_a_lost_connection_is_told_in_the_page(page, explorer):
    """The last test, since the page is lost then: Bokeh itself would tell it over the page."""
    keep = """const plain = WebSocket;
        window.opened = [];
        window.WebSocket = class extends plain {
            constructor(...given) { super(...given); window.opened.push(this); }
        };"""
    page.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": keep})
    page.get(explorer.url)
    wait(page, "return points() && points().data.x0.length === 2000")
    page.execute_script("window.opened.forEach((each) => each.close())")
    wait(page, "return figure('said top').text.includes('The program behind this page has ended')")
    assert run(page, "return Bokeh.documents[0].config.notify_connection_status") is False

"""How long hybrid.explore takes from a drag to the redrawn picture, in Chromium without a display.

The founding system with 2000 forcing periods in the section; browser and server share the machine. Needs
selenium, Chromium and its driver (Debian: apt-get install chromium chromium-driver).
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time

import numpy as np

import hybrid
import models
from benchmarks.common import heading, table

ALL = "const all = [...(globalThis.Bokeh?.documents[0]?._all_models.values() ?? [])];"
DONE = f"{ALL} return all.some((each) => each.type.endsWith('Progress') && each.value === 100)"
DRAG = f"""{ALL}
const done = arguments[arguments.length - 1];
const [from, to, count, pause] = arguments;
const source = all.find((each) => each.name === "section").renderers
    .map((each) => each.data_source).find((each) => each.data && each.data.mode !== undefined);
const slider = all.find((each) => each.type === "Slider" && each.title.startsWith("omega ("));
const times = [];
const next = (i) => {{
    if (i === count) {{ done(times); return; }}
    const begin = performance.now();
    const arrived = () => {{
        const there = performance.now() - begin;
        source.properties.data.change.disconnect(arrived);
        requestAnimationFrame(() => setTimeout(() => {{
            times.push([there, performance.now() - begin]);
            setTimeout(() => next(i + 1), pause);
        }}, 0));
    }};
    source.properties.data.change.connect(arrived);
    slider.value = from + (to - from) * (i + 1) / count;
}};
next(0);
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drags", type=int, default=60, help="number of drags (default: %(default)s)")
    count = parser.parse_args().drags
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (chromium and driver):
        sys.exit("Chromium and chromedriver are needed: apt-get install chromium chromium-driver")
    from selenium import webdriver

    heading(__doc__.splitlines()[0])
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for each in ("--headless=new", "--no-sandbox", "--window-size=1280,1000"):
        options.add_argument(each)
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    browser.set_script_timeout(120)
    system, given = models.vibroimpact(), {"omega": 7.46}
    explorer = hybrid.explore(
        system, (0.0,) * 4, mode="free", parameters=given, ranges={"omega": (7.3, 8.0)}, block=False
    )
    try:
        browser.get(explorer.url)
        for _ in range(240):
            time.sleep(0.5)
            if browser.execute_script(DONE):
                break
        rows = []
        # Slow drags leave time for the exponents in between, quick ones do not.
        for name, pause in (("one drag every half second", 500), ("drags without a pause", 0)):
            times = np.array(browser.execute_async_script(DRAG, 7.46, 7.92, count, pause))
            arrived, drawn = np.median(times, axis=0)
            rows.append((name, f"{arrived:.0f}", f"{drawn:.0f}", f"{np.percentile(times[:, 1], 90):.0f}"))
        begin = time.perf_counter()
        for _ in range(20):
            hybrid.stroboscopic_section(
                system, (0.0,) * 4, mode="free", parameters=given, periods=2000, transient=200
            )
        alone = (time.perf_counter() - begin) / 20 * 1000
    finally:
        browser.quit()
        explorer.stop()
    table(("", "points arrived, ms", "redrawn, ms", "redrawn, 90 %, ms"), rows)
    print(f"\nThe section alone, without the page: {alone:.0f} ms.")


if __name__ == "__main__":
    main()

"""The picture and the animation of the page to play with: ``python docs/make_explore.py --output docs``.

Chromium and its driver are needed (Debian: ``apt-get install chromium chromium-driver``), and selenium.
"""

from __future__ import annotations

import argparse
import io
import shutil
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image

import hybrid
import models

# The three regimes of the paper: an orbit of one period, a torus, chaos.
FRAMES = np.concatenate([np.linspace(7.40, 7.54, 15), np.linspace(7.56, 7.92, 13)])
WIDTH, HEIGHT = 1280, 1560
STILL = (0, 0, WIDTH, 1330)
# The part of the page that is animated, its width then, and milliseconds per frame.
PART, SHOWN, PACE = (0, 0, 1280, 770), 800, 180
MODELS = "const all = [...(globalThis.Bokeh?.documents[0]?._all_models.values() ?? [])];"
IS_DRAWN = f"""{MODELS}
    return all.some((each) => each.type.endsWith("Progress") && each.value === 100)"""
MOVE = f"""{MODELS}
    all.find((each) => each.type === "Slider" && each.title.startsWith("omega (")).value = arguments[0];"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the pictures")
    folder = parser.parse_args().output
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (chromium and driver):
        sys.exit("Chromium and chromedriver are needed: apt-get install chromium chromium-driver")
    folder.mkdir(parents=True, exist_ok=True)
    browser = opened(chromium, driver)
    explorer = hybrid.explore(
        models.vibroimpact(), (0.0, 0.0, 0.0, 0.0), mode="free", ranges={"omega": (7.3, 8.0)}, block=False
    )
    try:
        browser.get(explorer.url)
        for _ in range(120):
            time.sleep(0.5)
            if browser.execute_script(IS_DRAWN):
                break
        frames = []
        for omega in FRAMES:
            browser.execute_script(MOVE, float(omega))
            time.sleep(0.8)
            frames.append(Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB"))
        animate(frames, folder / "explore.gif")
        frames[-1].crop(STILL).quantize(128).save(folder / "explore.png", optimize=True)
    finally:
        browser.quit()
        explorer.stop()


def opened(chromium: str, driver: str):
    """A browser without a display."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    size = f"--window-size={WIDTH},{HEIGHT + 140}"
    for each in ("--headless=new", "--no-sandbox", "--hide-scrollbars", size):
        options.add_argument(each)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))


def animate(frames: list[Image.Image], file: Path) -> None:
    """Save the frames as an animation that runs there and back."""
    height = round(SHOWN * (PART[3] - PART[1]) / (PART[2] - PART[0]))
    small = [each.crop(PART).resize((SHOWN, height), Image.Resampling.LANCZOS) for each in frames]
    palette = small[-1].quantize(48, dither=Image.Dither.NONE)
    shown = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in small]
    first, *rest = [*shown, *shown[-2:0:-1]]
    first.save(file, save_all=True, append_images=rest, duration=PACE, loop=0, optimize=True)


if __name__ == "__main__":
    main()

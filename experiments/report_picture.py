"""A picture of a gap report's first screen: ``python experiments/report_picture.py REPORT.html
PICTURE.png``.

The picture reaches to the end of the first table. It needs ``pip install '.[docs]'`` and Chromium,
whose path may be in JAXIDL_BROWSER.
"""

import argparse
import os
import shutil
from pathlib import Path

WIDTH, MARGIN, SCALE = 1100, 12, 1.5  # pixels of the page, and of the picture for each of them
FLAGS = ["--no-sandbox", "--disable-gpu"]


def picture(page_file: Path, out: Path) -> None:
    """Write the picture of a page to a file."""
    from playwright.sync_api import sync_playwright

    path = os.environ.get("JAXIDL_BROWSER") or shutil.which("chromium")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path, args=FLAGS)
        page = browser.new_page(viewport={"width": WIDTH, "height": 800}, device_scale_factor=SCALE)
        page.goto(page_file.resolve().as_uri())
        box = page.locator("table").first.bounding_box()
        assert box is not None
        height = box["y"] + box["height"] + MARGIN
        page.set_viewport_size({"width": WIDTH, "height": round(height)})
        page.screenshot(path=out)
        browser.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("report", type=Path)
    parser.add_argument("picture", type=Path)
    given = parser.parse_args()
    picture(given.report, given.picture)

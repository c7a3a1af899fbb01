"""The documentation: it builds without a warning, its links lead somewhere, and a browser shows
every page without complaint, on a phone, too.
"""

import functools
import http.server
import importlib.util
import os
import shutil
import subprocess
import sys
import threading
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest
from filelock import FileLock

from tests.helpers.paths import ROOT

PHONE, SCREEN = {"width": 390, "height": 844}, {"width": 1280, "height": 900}
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Path:
    """The built site, once for all of pytest's processes; notebooks that ran already are kept."""
    for name in ("sphinx", "myst_nb", "furo", "jupytext"):
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed: pip install '.[docs]'")
    base = tmp_path_factory.getbasetemp()
    out = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "site"
    with FileLock(f"{out}.lock"):
        if not (out / "passed").exists():
            # this one runs as a script in tests/gap/test_own_effect.py
            env = os.environ | {"JAXIDL_DOCS_NOT_RUN": "*/your_own_effect.py"}
            command = [sys.executable, "-m", "sphinx", "-E", "-q", "-W", "--keep-going"]
            built = subprocess.run(
                [*command, ROOT / "docs", out], capture_output=True, text=True, env=env
            )
            assert built.returncode == 0, built.stdout[-4000:] + built.stderr[-8000:]
            (out / "passed").touch()
    return out


class Page(HTMLParser):
    """Anchors and internal addresses of a page."""

    def __init__(self, path: Path):
        super().__init__()
        self.anchors, self.links = {""}, set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        for key, value in attrs:
            if key in ("id", "name") and value:
                self.anchors.add(value)
            if key in ("href", "src") and value and "://" not in value:
                self.links.add(value)


def pages(site: Path) -> list[Path]:
    return sorted(site.rglob("*.html"))


def test_every_internal_link_and_picture_is_there(site):
    found = {path: Page(path) for path in pages(site)}
    assert len(found) > 50
    broken = []
    for path, page in found.items():
        for link in page.links:
            if link.startswith(("mailto:", "data:", "javascript:")):
                continue
            name, anchor = urldefrag(unquote(link))
            name = name.partition("?")[0]
            target = (path.parent / name).resolve() if name else path
            if target.is_dir():
                target /= "index.html"
            if not target.exists():
                broken.append(f"{path.relative_to(site)}: {link}")
            elif target in found and anchor not in found[target].anchors:
                broken.append(f"{path.relative_to(site)}: no #{anchor} in {name}")
    assert not broken, "\n".join(broken)


@pytest.fixture(scope="module")
def address(site):
    """The site under an address, as readers have it."""
    quiet = type("Quiet", (http.server.SimpleHTTPRequestHandler,), {"log_message": lambda *_: None})
    handler = functools.partial(quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="session")
def program():
    """The program of a browser. Tests ask for it first: without one nobody waits for the site."""
    api = pytest.importorskip("playwright.sync_api", reason="pip install '.[docs]'")
    names = ("chromium", "chromium-browser", "google-chrome")
    path = os.environ.get("JAXIDL_BROWSER") or next(filter(None, map(shutil.which, names)), None)
    if path is None:
        with api.sync_playwright() as play:
            path = play.chromium.executable_path
    if not Path(path).exists():
        pytest.skip("no browser: install chromium, or name one in JAXIDL_BROWSER")
    return path


@pytest.fixture(scope="module")
def browser(program, tmp_path_factory):
    """A browser without a window, and what it complains about."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        context = play.chromium.launch_persistent_context(
            tmp_path_factory.mktemp("browser"), executable_path=program, args=FLAGS, viewport=PHONE
        )
        yield context
        context.close()


@pytest.fixture
def page(browser):
    """A page of the browser; whatever it complains about fails the test."""
    said, page = [], browser.new_page()
    page.on(
        "console",
        lambda m: (
            said.append(f"{m.text} ({m.location})") if m.type in ("error", "warning") else None
        ),
    )
    page.on("pageerror", lambda error: said.append(str(error)))
    # what is still on its way when the next page is asked for is given up, which is no failure
    page.on(
        "requestfailed",
        lambda r: None if r.failure == "net::ERR_ABORTED" else said.append(f"not fetched: {r.url}"),
    )
    page.on("response", lambda r: said.append(f"{r.status}: {r.url}") if r.status >= 400 else None)
    yield page
    page.close()
    assert not said, "\n".join(said)


@pytest.mark.usefixtures("program")
def test_every_page_fits_a_phone_and_shows_its_pictures(site, address, page):
    wide, missing = [], []
    page.set_viewport_size(PHONE)
    for path in pages(site):
        name = path.relative_to(site).as_posix()
        page.goto(f"{address}/{name}", wait_until="load")
        width = page.evaluate("document.documentElement.scrollWidth")
        if width > PHONE["width"]:
            wide.append(f"{name}: {width} pixels")
        missing += page.evaluate(
            """() => [...document.querySelectorAll("article img")]
                .filter(i => i.loading !== "lazy" && !(i.complete && i.naturalWidth))
                .map(i => i.src)"""
        )
    assert not wide, "\n".join(wide)
    assert not missing, "\n".join(missing)


@pytest.mark.usefixtures("program")
def test_nothing_is_fetched_from_elsewhere(site, address, page):
    elsewhere = []
    page.on(
        "request",
        lambda r: None if r.url.startswith((address, "data:")) else elsewhere.append(r.url),
    )
    for name in ("index", "explanation/method", "notebooks/first_learning_run", "search"):
        page.goto(f"{address}/{name}.html", wait_until="networkidle")
    assert not elsewhere, "\n".join(elsewhere)


@pytest.mark.usefixtures("program")
def test_search_finds_pages(address, page):
    page.set_viewport_size(SCREEN)
    page.goto(f"{address}/search.html?q=payload", wait_until="load")
    page.wait_for_selector("#search-results li a", timeout=20_000)
    page.wait_for_load_state("networkidle")
    found = page.eval_on_selector_all("#search-results li a", "links => links.map(a => a.href)")
    for name in ("reference/effects", "notebooks/what_changed"):
        assert any(name in link for link in found), found


@pytest.mark.usefixtures("program")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pictures_stand_on_white(address, page, scheme):
    page.set_viewport_size(SCREEN)
    page.emulate_media(color_scheme=scheme)
    page.goto(f"{address}/explanation/arm.html", wait_until="load")
    image, body = (
        page.evaluate(f"getComputedStyle(document.querySelector('{what}')).backgroundColor")
        for what in ("article img", "body")
    )
    dark = scheme == "dark"
    assert (image == "rgb(255, 255, 255)") == dark
    assert (body == "rgb(255, 255, 255)") != dark

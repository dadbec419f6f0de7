"""Pages in a real browser: Chromium without a window, asked through two pipes (the DevTools protocol)."""

import base64
import json
import os
import re
import select
import shutil
import subprocess
import time

NAMES = ("chromium", "chromium-browser", "google-chrome")
LIMIT = 60.0  # seconds to wait for an answer
SLOW_DRIVER = "GL Driver Message (OpenGL, Performance"  # graphics in software say that they are slow
SETTLED = "document.readyState === 'complete' && Array.from(document.images).every(i => i.complete)"


def browser_path():
    """Return the path of a Chromium, or None."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """A browser with one page, width x height pixels.  Messages of its console are kept in `console`."""

    def __init__(self, folder, width=1440, height=900):
        (theirs, self._to), (self._from, back) = os.pipe(), os.pipe()
        flags = f"--headless --no-sandbox --remote-debugging-pipe --user-data-dir={folder} --no-first-run"
        # without a network, and with a graphics processor in software
        flags += " --proxy-server=127.0.0.1:9 --enable-unsafe-swiftshader"
        # the browser reads its descriptor 3 and writes to its descriptor 4
        command = f'exec "$0" {flags} about:blank 3<&{theirs} 4>&{back}'
        self._process = subprocess.Popen(
            ["bash", "-c", command, browser_path()],
            pass_fds=(theirs, back),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs)
        os.close(back)
        self._buffer, self._number, self._session, self.console = b"", 0, None, []
        pages = self.ask("Target.getTargets")["targetInfos"]
        page = next(p["targetId"] for p in pages if p["type"] == "page")
        self._session = self.ask("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")
        self.resize(width, height)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._process.terminate()
        self._process.wait(10)
        os.close(self._to)
        os.close(self._from)

    def ask(self, method, **parameters):
        """Return the answer to a command."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, (method, answer)
                return answer["result"]
            self._note(answer)

    def resize(self, width, height=900):
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.ask("Emulation.setDeviceMetricsOverride", **size)

    def open(self, path):
        """Show a file, and wait until it and its pictures are there."""
        self.console.clear()
        self.ask("Page.navigate", url=path.resolve().as_uri())
        end = time.monotonic() + LIMIT
        while not (self.value("location.protocol") == "file:" and self.value(SETTLED)):
            assert time.monotonic() < end, f"{path} is not complete after {LIMIT} s"
            time.sleep(0.05)

    def value(self, expression):
        """Return the value of an expression of the page."""
        asked = {"expression": expression, "returnByValue": True, "awaitPromise": True}
        return self.ask("Runtime.evaluate", **asked)["result"].get("value")

    def pdf(self):
        """Return the page as it is printed, with the paper that its style asks for."""
        return base64.b64decode(self.ask("Page.printToPDF", preferCSSPageSize=True)["data"])

    def picture(self):
        """Return the whole page as PNG."""
        return base64.b64decode(self.ask("Page.captureScreenshot", captureBeyondViewport=True)["data"])

    def _note(self, event):
        if event.get("method") == "Runtime.consoleAPICalled":
            self.console.append(event["params"]["args"])
        elif event.get("method") == "Runtime.exceptionThrown":
            self.console.append(event["params"]["exceptionDetails"])
        elif event.get("method") == "Log.entryAdded":
            entry = event["params"]["entry"]
            if SLOW_DRIVER not in entry["text"]:
                self.console.append(entry)

    def _read(self):
        """Return the next message."""
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._from], [], [], LIMIT)
            assert ready, f"the browser is silent for {LIMIT} s"
            part = os.read(self._from, 1 << 20)
            assert part, "the browser has ended"
            self._buffer += part
        message, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(message)


def pdf_pages(pdf):
    """Return the number of pages of a PDF, and the sizes of their papers in points."""
    sizes = re.findall(rb"/Type\s*/Page\b[^s].*?/MediaBox\s*\[\s*0\s+0\s+([\d.]+)\s+([\d.]+)", pdf, re.DOTALL)
    return len(re.findall(rb"/Type\s*/Page\b(?!s)", pdf)), [(float(w), float(h)) for w, h in sizes]

"""A headless Chromium driven over its own pipe: pages, what they say, what they show."""

from __future__ import annotations

import base64
import fcntl
import itertools
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")


def chromium():
    """Path of the browser, None where there is none."""
    return next((found for name in PROGRAMS if (found := shutil.which(name))), None)


class Browser:
    """One page in a headless browser; use it in a ``with``.

    Attributes
    ----------
    complaints : list of str
        Errors and warnings of the console, and exceptions.
    """

    def __init__(self, size=(640, 360)):
        self.size, self.complaints, self._numbers, self._buffer = size, [], itertools.count(1), b""
        self._home = tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True)
        theirs_in, self._out = os.pipe()
        self._in, theirs_out = os.pipe()
        arguments = [
            chromium(), "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--enable-unsafe-swiftshader",
            "--use-angle=swiftshader", "--disable-gpu-sandbox", "--no-first-run", "--disable-extensions",
            "--disable-background-networking", "--hide-scrollbars", f"--user-data-dir={self._home.name}",
            f"--window-size={size[0]},{size[1]}", "about:blank",
        ]  # fmt: skip

        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (theirs_in, theirs_out)]

        def as_it_expects():
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)

        self._process = subprocess.Popen(
            arguments, pass_fds=(3, 4), preexec_fn=as_it_expects, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        for end in ends:
            os.close(end)
        os.close(theirs_in)
        os.close(theirs_out)
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")
        self.ask(
            "Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=-1, uploadThroughput=-1
        )
        self.ask("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)

    def open(self, path):
        """Load a file."""
        self.ask("Page.navigate", url=Path(path).resolve().as_uri())

    def evaluate(self, expression, seconds=60):
        """What an expression comes to; promises are waited for. RuntimeError with what it throws."""
        asked = {"expression": expression, "awaitPromise": True, "returnByValue": True}
        told = self.ask("Runtime.evaluate", seconds=seconds, **asked)
        if "exceptionDetails" in told:
            raise RuntimeError(json.dumps(told["exceptionDetails"])[:2000])
        return told["result"].get("value")

    def click(self, x, y):
        """A click of the left button."""
        for kind in ("mousePressed", "mouseReleased"):
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def drag(self, start, end, button="left"):
        """A button held from one point to another."""
        (x, y), (u, v) = start, end
        held = {"button": button, "buttons": {"left": 1, "right": 2, "middle": 4}[button]}
        self.ask("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, clickCount=1, **held)
        for k in range(1, 5):
            at = {"x": x + (u - x) * k / 4, "y": y + (v - y) * k / 4}
            self.ask("Input.dispatchMouseEvent", type="mouseMoved", **held, **at)
        self.ask("Input.dispatchMouseEvent", type="mouseReleased", x=u, y=v, button=button, buttons=0, clickCount=1)

    def picture(self, path):
        """Keep what it shows as a PNG."""
        Path(path).write_bytes(base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"]))

    def ask(self, method, seconds=60, **arguments):
        """Result of a command to the page."""
        return self._ask(method, seconds, session=self._session, **arguments)

    def _ask(self, method, seconds=60, session=None, **arguments):
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": arguments}
        if session:
            message["sessionId"] = session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        until = time.monotonic() + seconds
        while True:
            told = self._read(until, method)
            self._note(told)
            if told.get("id") == number:
                if "error" in told:
                    raise RuntimeError(f"{method}: {told['error']['message']}")
                return told["result"]

    def _read(self, until, method):
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._in], [], [], max(0, until - time.monotonic()))
            if not ready:
                raise TimeoutError(f"the browser does not answer {method}")
            more = os.read(self._in, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self._buffer += more
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def _note(self, told):
        kind, about = told.get("method"), told.get("params", {})
        if kind == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(about["exceptionDetails"])[:1000])
        if kind == "Runtime.consoleAPICalled" and about["type"] in ("error", "warning", "assert"):
            self.complaints.append(" ".join(str(part.get("value")) for part in about["args"]))
        if kind == "Log.entryAdded" and about["entry"]["level"] in ("error", "warning"):
            self.complaints.append(about["entry"]["text"])

    def close(self):
        """End the browser and all its children."""
        try:
            self._ask("Browser.close", 5)
        except (RuntimeError, TimeoutError, OSError):
            pass
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        for end in (self._in, self._out):
            os.close(end)
        self._home.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

"""A headless Chromium driven over its own pipe (the DevTools protocol): no package, no port."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SWITCHES = (
    "--headless", "--no-sandbox", "--remote-debugging-pipe", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-extensions", "--no-first-run", "--disable-background-networking", "--hide-scrollbars", "--mute-audio",
)  # fmt: skip
WAIT_S = 60.0


class Browser:
    """One page; use it with `with`. What the page did wrong gathers in `mistakes`, what it asked for in `requests`."""

    def __init__(self, *switches: str) -> None:
        self.mistakes: list[str] = []
        self.requests: list[str] = []
        self._next = 0
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        (their_read, self._write), (self._read, their_write) = os.pipe(), os.pipe()

        def as_three_and_four() -> None:
            first, second = os.dup(their_read), os.dup(their_write)
            os.dup2(first, 3)
            os.dup2(second, 4)

        assert CHROMIUM is not None
        command = [CHROMIUM, *SWITCHES, f"--user-data-dir={self._profile.name}", *switches, "about:blank"]
        self._process = subprocess.Popen(
            command, preexec_fn=as_three_and_four, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(their_read)
        os.close(their_write)
        self._left = b""
        self._session = ""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command of the protocol, answered. Raises `AssertionError` with the browser's words."""
        self._next += 1
        message = {"id": self._next, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self._next:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return dict(answer["result"])

    def open(self, page: Path, width: int = 480, height: int = 600, scheme: str = "light") -> None:
        """Load a file, and wait until it shows a picture or says why not."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.call("Page.navigate", url=page.as_uri())
        self.wait(
            "window.spectrasplat || !document.getElementById('problem')?.hidden && document.getElementById('problem')"
        )

    def run(self, script: str) -> Any:
        """Value of an expression of JavaScript in the page; promises are awaited."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait(self, condition: str) -> None:
        """Until an expression is true."""
        until = time.monotonic() + WAIT_S
        while not self.run(f"Boolean({condition})"):
            assert time.monotonic() < until, f"waited in vain for {condition}: {self.mistakes}"
            time.sleep(0.02)

    def floats(self, script: str) -> np.ndarray:
        """A Float32Array."""
        text = f"""(() => {{
            const values = {script}, bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
            let letters = '';
            for (const byte of bytes) letters += String.fromCharCode(byte);
            return btoa(letters);
        }})()"""
        return np.frombuffer(base64.b64decode(self.run(text)), np.float32)

    def screenshot(self, path: Path, whole: bool = True) -> None:
        """The page as a PNG file."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", captureBeyondViewport=whole)["data"]))

    def _receive(self) -> dict[str, Any]:
        while b"\0" not in self._left:
            self._left += os.read(self._read, 1 << 20)
        text, self._left = self._left.split(b"\0", 1)
        message = dict(json.loads(text))
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, method: str, parameters: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent" and not parameters["request"]["url"].startswith("data:"):
            self.requests.append(parameters["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.mistakes.append(str(parameters["exceptionDetails"].get("exception", {}).get("description")))
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
            self.mistakes.append(str([value.get("value") for value in parameters["args"]]))
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.mistakes.append(parameters["entry"]["text"])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._read)
        os.close(self._write)
        self._profile.cleanup()

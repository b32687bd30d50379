"""A headless Chromium, spoken to over a pipe in the DevTools protocol; one for all pages of a test session."""

import base64
import contextlib
import itertools
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

PROGRAM = shutil.which("chromium")
_PATIENCE = 30.0
_NAVIGATED = (
    "Inspected target navigated",
    "Execution context was destroyed",
    "Cannot find context",
    "Promise was collected",
)
KEYS = {"ArrowLeft": 37, "ArrowRight": 39, "Home": 36, "End": 35, " ": 32}


class Navigated(Exception):
    """The page went to another address while it was asked something."""


class Chromium:
    """The browser; ``call`` sends a command, ``events`` holds what it said besides the answers."""

    def __init__(self, profile: Path) -> None:
        commands, self._commands = os.pipe()
        self._answers, answers = os.pipe()
        words = [str(PROGRAM), "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                 "--no-first-run", "--disable-extensions", "--disable-background-networking", "--remote-debugging-pipe",
                 "--disable-quic", "--disable-component-update", "--disable-sync",
                 f"--user-data-dir={profile}", "about:blank"]  # fmt: skip
        joined = ["bash", "-c", f'exec "$@" 3<&{commands} 4>&{answers}', "bash", *words]
        self._process = subprocess.Popen(
            joined, pass_fds=(commands, answers), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(commands)
        os.close(answers)
        self._numbers = itertools.count(1)
        self._rest = b""
        self.events: list[dict[str, Any]] = []

    def call(self, method: str, session: str = "", **parameters: Any) -> Any:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters, **({"sessionId": session} if session else {})}
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._commands, data) :]
        for answer in self._messages():
            if answer.get("id") == number:
                if answer.get("error", {}).get("message", "").startswith(_NAVIGATED):
                    raise Navigated(answer)
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)
        raise AssertionError("Chromium ended")

    def _messages(self) -> Iterator[Any]:
        until = time.monotonic() + _PATIENCE
        while True:
            message, found, rest = self._rest.partition(b"\0")
            if found:
                self._rest = rest
                yield json.loads(message)
                continue
            assert select.select([self._answers], [], [], until - time.monotonic())[0], "Chromium does not answer"
            data = os.read(self._answers, 1 << 20)
            if not data:
                return
            self._rest += data

    def close(self) -> None:
        try:
            self.call("Browser.close")
        finally:
            os.close(self._commands)
            os.close(self._answers)
            self._process.wait(_PATIENCE)

    @contextmanager
    def page(self, address: str, width: int = 1366, height: int = 768, dark: bool = False) -> Iterator["Page"]:
        """A page that has loaded its address."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, session)
        for domain in ("Page", "Runtime", "Log", "Network"):
            page.call(f"{domain}.enable")
        page.resize(width, height)
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        page.call("Emulation.setEmulatedMedia", features=scheme)
        page.go(address)
        yield page
        self.call("Target.closeTarget", targetId=target)


@dataclass
class Page:
    """One page; ``faults`` are its errors, ``requests`` the addresses that it asked for."""

    browser: Chromium
    session: str
    _seen: int = field(init=False)

    def __post_init__(self) -> None:
        self._seen = len(self.browser.events)

    def call(self, method: str, **parameters: Any) -> Any:
        return self.browser.call(method, self.session, **parameters)

    def resize(self, width: int, height: int) -> None:
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def go(self, address: str) -> None:
        self.call("Page.navigate", url=address)
        self.wait("location.href !== 'about:blank' && document.readyState === 'complete'")

    def wait(self, condition: str) -> None:
        """Until a condition holds, which two pictures on the screen may pass for, also on the page that comes next."""
        until = time.monotonic() + _PATIENCE
        frames = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
        holds = False
        while not holds:
            with contextlib.suppress(Navigated):
                holds = bool(self.value(f"{frames}.then(() => Boolean({condition}))"))
            assert holds or time.monotonic() < until, condition

    def value(self, expression: str) -> Any:
        """What an expression is, also a promised one."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def press(self, key: str) -> None:
        code = {"key": key, "windowsVirtualKeyCode": KEYS[key], **({"text": key} if len(key) == 1 else {})}
        self.call("Input.dispatchKeyEvent", type="keyDown", **code)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def click(self, x: float, y: float) -> None:
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1, buttons=1)

    def picture(self) -> bytes:
        """What is on the screen, as a PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def pixels(self) -> NDArray[np.uint8]:
        """The same as an array (height, width, 3)."""
        return np.asarray(cv2.imdecode(np.frombuffer(self.picture(), np.uint8), cv2.IMREAD_COLOR), np.uint8)

    def settled(self) -> NDArray[np.uint8]:
        """The same when nothing moves on it any more."""
        before = self.pixels()
        for _ in range(50):
            self.wait("true")
            now = self.pixels()
            if (now == before).all():
                break
            before = now
        return before

    @property
    def faults(self) -> list[Any]:
        return [
            *self._said("Runtime.exceptionThrown"),
            *(event for event in self._said("Log.entryAdded") if event["entry"]["level"] == "error"),
            *(event for event in self._said("Runtime.consoleAPICalled") if event["type"] in ("error", "assert")),
        ]

    @property
    def requests(self) -> list[str]:
        return [event["request"]["url"] for event in self._said("Network.requestWillBeSent")]

    def _said(self, method: str) -> list[Any]:
        return [
            event["params"]
            for event in self.browser.events[self._seen :]
            if event["method"] == method and event.get("sessionId") == self.session
        ]

"""A headless Chromium driven over its debugging pipe (Chrome DevTools Protocol): no package, no port, no network."""

from __future__ import annotations

import json
import os
import select
import shlex
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
OPTIONS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --disable-dev-shm-usage --no-first-run"
    " --disable-background-networking --disable-component-update --disable-sync --window-size=1280,960"
)
PATIENCE_S = 90.0


class Browser:
    """One page."""

    def __init__(self, program: str, folder: Path) -> None:
        """Start it; ``folder`` takes the profile."""
        theirs, self._to = os.pipe()
        self._from, back = os.pipe()
        # The pipe's two ends are by convention descriptors 3 and 4.
        command = f"exec {shlex.quote(program)} {OPTIONS} --user-data-dir={shlex.quote(str(folder / 'profile'))}"
        command += f" --remote-debugging-pipe about:blank 3<&{theirs} 4>&{back}"
        self._process = subprocess.Popen(["bash", "-c", command], pass_fds=(theirs, back), stderr=subprocess.DEVNULL)
        os.close(theirs)
        os.close(back)
        self._number, self._pending, self._session = 0, b"", ""
        self._errors: list[Any] = []

    def open(self, url: str) -> None:
        """Go to a page."""
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")
        self._call("Page.navigate", url=url)

    def resize(self, width: int, height: int) -> None:
        """Lay the page out for a window of so many pixels."""
        self._call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    def value(self, expression: str) -> Any:
        """What an expression of JavaScript comes to."""
        return self._call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def text(self, selector: str) -> str:
        """The text an element shows; empty where there is none."""
        return str(self.value(f"document.querySelector({selector!r})?.innerText ?? ''"))

    def wait_for(self, selector: str, text: str) -> None:
        """Wait until an element shows a text."""
        deadline = time.monotonic() + PATIENCE_S
        while (shown := self.text(selector)) != text:
            assert time.monotonic() < deadline, f"{selector} shows {shown!r}, not {text!r}"
            time.sleep(0.05)

    def wait_until(self, expression: str) -> None:
        """Wait until an expression of JavaScript is true."""
        deadline = time.monotonic() + PATIENCE_S
        while self.value(expression) is not True:
            assert time.monotonic() < deadline, f"{expression} stays untrue"
            time.sleep(0.05)

    def click(self, selector: str) -> None:
        """Press and release the mouse's button in the middle of an element, scrolled to where it can be seen."""
        place = f"""(() => {{
          const element = document.querySelector({selector!r});
          element.scrollIntoView({{ block: "center", behavior: "instant" }});
          const box = element.getBoundingClientRect();
          return [box.x + box.width / 2, box.y + box.height / 2];
        }})()"""
        x, y = self.value(place)
        for kind in ("mousePressed", "mouseReleased"):
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def errors(self) -> list[Any]:
        """Exceptions of the page, and what the browser counts as its errors."""
        return self._errors

    def close(self) -> None:
        """End the browser."""
        # A browser whose pipe is closed ends by itself, and its helpers with it.
        os.close(self._to)
        os.close(self._from)
        try:
            self._process.wait(30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._number:
            if answer.get("method") == "Runtime.exceptionThrown" or _level(answer) == "error":
                self._errors.append(answer["params"])
        assert "error" not in answer, answer
        return dict(answer["result"])

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._pending:
            assert select.select([self._from], [], [], PATIENCE_S)[0], "the browser says nothing"
            self._pending += os.read(self._from, 1 << 16)
        line, self._pending = self._pending.split(b"\0", 1)
        return dict(json.loads(line))


def _level(event: dict[str, Any]) -> str:
    """How grave a line of the browser's log is; empty for any other event."""
    return str(event["params"]["entry"]["level"]) if event.get("method") == "Log.entryAdded" else ""

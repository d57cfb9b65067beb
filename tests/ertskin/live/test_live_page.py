"""The page in a real browser, where one is installed: what it draws, what its buttons do, what it says at a failure."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser

from ertskin.live.message import fault_of, line_of, message_of
from ertskin.live.server import Channel, LiveServer
from ertskin.live.session import Contact, LiveFrame
from ertskin.physics.sensor import taxel_grid_m

TAXEL_M = taxel_grid_m((0.12, 0.12), 6, 6)
CELL = """(() => {
  const [x, y] = [%d, %d], size = document.querySelector("#map").width;
  const pen = document.querySelector("#map").getContext("2d");
  return [...pen.getImageData((x + 0.15) / 6 * size, size - (y + 0.15) / 6 * size, 1, 1).data];
})()"""


def line(number: int, contacts: tuple[Contact, ...] = (), recorded: int | None = None, **changes: object) -> str:
    """A message of the live command."""
    force = np.zeros(36)
    for contact in contacts:
        force[int(np.argmin(np.hypot(*(TAXEL_M - [contact.x_m, contact.y_m]).T)))] = contact.force_n
    fields = {"latency_s": 4.2e-4, "rate_hz": 2.0, "drift": 0.3, "lost": 0, "saturated": 0.0, "zeroing": False}
    frame = LiveFrame(number, 0.5 * number, force, contacts, **{**fields, **changes})  # type: ignore[arg-type]
    return line_of(message_of(frame, TAXEL_M, 1e9, recorded))


@pytest.fixture
def page(tmp_path: Path) -> Iterator[tuple[Browser, Channel, list[str]]]:
    """A browser at the page, what feeds it, and the orders it gave."""
    orders: list[str] = []
    channel = Channel()

    def taken(name: str) -> str:
        orders.append(name)
        return f"{name} done"

    with ExitStack() as stack:
        server = LiveServer(channel, 0, {f"/{name}": lambda name=name: taken(name) for name in ("zero", "record")})
        stack.callback(server.close)
        browser = Browser(str(CHROMIUM), tmp_path)
        stack.callback(browser.close)
        browser.open(server.url)
        yield browser, channel, orders


@pytest.mark.skipif(CHROMIUM is None, reason="no browser is installed")
def test_the_page_shows_what_the_skin_feels(page: tuple[Browser, Channel, list[str]]) -> None:
    browser, channel, orders = page
    channel.send(line(1, zeroing=True))
    browser.wait_for("#state", "zeroing: do not touch")
    channel.send(line(2))
    browser.wait_for("#state", "running")
    assert browser.text("#contacts") == "nothing touches"
    dark = browser.value(CELL % (2, 4))
    channel.send(line(3, (Contact(0.05, 0.09, 3.25), Contact(0.11, 0.01, 0.5)), recorded=7))
    browser.wait_for("#frame", "3")
    assert browser.text("#contacts").split() == ["50.0", "90.0", "3.25", "110.0", "10.0", "0.50"]
    assert (browser.text("#latency"), browser.text("#rate"), browser.text("#most")) == ("0.42 ms", "2.0", "5 N")
    assert sum(browser.value(CELL % (2, 4))) > sum(dark) + 100
    assert browser.value(CELL % (0, 0)) == dark
    assert "7 frames" in browser.text("#kept")
    assert "Stop" in browser.text("#record")
    channel.send(line(4, drift=4.0))
    browser.wait_for("#frame", "4")
    assert "drifted by 4.0" in browser.text("#warnings")
    browser.click("#zero")
    browser.wait_for("#answer", "zero done")
    browser.click("#record")
    browser.wait_for("#answer", "record done")
    assert orders == ["zero", "record"]
    channel.send(line_of(fault_of("ERT reader: contact lost", 1e9)))
    browser.wait_for("#state", "ERT reader: contact lost")
    channel.send(line(5))
    browser.wait_for("#state", "running")
    channel.close()
    browser.wait_for("#state", "ertskin live has ended")
    assert browser.errors() == []

"""What a person sees of a recording: the plan and its duration beforehand, presses and checks while it runs."""

from __future__ import annotations

import io

from rich.console import Console

from ertskin.bench.display import Display, print_plan
from ertskin.hardware.experiment import Progress
from ertskin.hardware.live_checks import Soundness
from ertskin.hardware.plan import Plan, Press, ramp, taxel_plan
from ertskin.physics.history import Phase
from ertskin.physics.sensor import taxel_grid_m


def console(terminal: bool = False) -> Console:
    """One that writes into memory."""
    return Console(file=io.StringIO(), width=200, force_terminal=terminal)


def said(by: Console) -> str:
    """What has been written."""
    assert isinstance(by.file, io.StringIO)
    return by.file.getvalue()


def progress(press: int, saturated: float = 0.0, presses: int = 12) -> Progress:
    """A frame in the middle of a press."""
    return Progress(press, presses, 3 * press + 1, 36, Phase.LOADING, 1e-3, 2.5, Soundness(saturated, 2e-3, 1.5e-3))


def test_a_plan_is_printed_with_its_duration() -> None:
    out = console()
    print_plan(out, taxel_plan(taxel_grid_m((0.12, 0.12), 6, 6), hold_s=4.0))
    assert "36 presses, 3097 frames, about 35 min" in said(out)
    assert "1 rest, 41 loading, 4 hold, 40 unloading" in said(out)
    out = console()
    print_plan(out, Plan("twice", (Press(((0.03, 0.05),), ramp(1e-3, 5e-4), rest_s=1.0),) * 2))
    assert "1 to 2" not in said(out)
    assert "0 to 1" in said(out)
    assert "(30.0, 50.0)" in said(out)
    assert " s\n" in said(out)


def test_without_a_terminal_a_few_lines_tell_how_it_goes() -> None:
    out = console()
    plan = Plan("many", (Press(((0.03, 0.05),), ramp(1e-3, 1e-3)),) * 12)
    with Display(out, plan) as display:
        for press in range(12):
            display.show(progress(press))
    lines = [line for line in said(out).splitlines() if line]
    assert [line.split("  ")[0] for line in lines] == [f"many: press {k}/12" for k in (1, 3, 5, 7, 9, 11)]
    assert all("noise 1.50 mV, reciprocity 0.2 %" in line for line in lines)


def test_on_a_terminal_force_depth_and_saturation_show() -> None:
    out = console(terminal=True)
    with Display(out, Plan("one", (Press(((0.03, 0.05),), ramp(1e-3, 1e-3)),))) as display:
        display.show(progress(0, saturated=0.1, presses=1))
    for text in ("press 1/1 loading 1.0 mm 2.50 N", "noise 1.50 mV", "10 % saturated"):
        assert text in said(out)

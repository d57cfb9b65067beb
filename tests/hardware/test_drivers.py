"""Every driver's exact traffic with its device, and what it makes of it."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest
from scripted_line import ScriptedLine

from ertskin.hardware.ert_readers.eit_kit import eit_kit
from ertskin.hardware.ert_readers.frame import Flag, Frame, Type, encode, scan_payload
from ertskin.hardware.ert_readers.link import ErtLink
from ertskin.hardware.ert_readers.spectra import spectra
from ertskin.hardware.ert_readers.text import TextReader
from ertskin.hardware.failure import LimitExceeded, LostContact, NoAnswer, Refusal
from ertskin.hardware.instrument import ErtReader, LoadCell, Stage, Travel
from ertskin.hardware.load_cells.futek import futek
from ertskin.hardware.load_cells.hx711 import hx711
from ertskin.hardware.load_cells.mark10 import Mark10
from ertskin.hardware.load_cells.stream import StreamingCell
from ertskin.hardware.stages.grbl import Grbl
from ertskin.hardware.stages.marlin import Marlin, numbered

TRAVEL = Travel((-0.2, -0.2, -0.1), (0.0, 0.0, 0.0))
BANNER = b"\r\nGrbl 1.1h ['$' for help]\r\n"
UPWARD = Travel((0.0, 0.0, 0.0), (0.2, 0.2, 0.1))


@pytest.mark.parametrize(
    ("driver", "interface"),
    [(Grbl, Stage), (Marlin, Stage), (Mark10, LoadCell), (StreamingCell, LoadCell), (ErtLink, ErtReader),
     (TextReader, ErtReader)],
)  # fmt: skip
def test_every_driver_keeps_to_its_interface(driver: type, interface: type) -> None:
    for name, wanted in inspect.getmembers(interface, inspect.isfunction):
        if name.startswith("_"):
            continue
        has = getattr(driver, name)
        assert inspect.getdoc(has), f"{driver.__name__}.{name} says nothing"
        assert list(inspect.signature(has).parameters) == list(inspect.signature(wanted).parameters)
    assert "rotocol" in (inspect.getmodule(driver).__doc__ or "") or driver in (StreamingCell, ErtLink, TextReader)


# ---------------------------------------------------------------------------------------------------------- GRBL


def test_grbl_moves_in_machine_coordinates() -> None:
    line = ScriptedLine(
        (b"?", b"<Idle|MPos:-10.000,-20.000,-5.000|FS:0,0|WCO:1.000,2.000,3.000>\r\n"),
        (b"G53 G1 X-10.000 Y-20.000 Z-6.500 F60.0\n", b"ok\r\n"),
        (b"?", b"<Run|MPos:-10.000,-20.000,-6.000|FS:60,0>\r\n"),
        (b"?", b"<Idle|MPos:-10.000,-20.000,-6.500|FS:0,0>\r\n"),
    )
    stage = Grbl(line, TRAVEL)
    assert stage.start_move(np.array([-0.01, -0.02, -0.0065]), 1e-3) == pytest.approx(1.5)
    assert stage.moving()
    assert not stage.moving()
    assert line.done()


def test_grbl_is_asked_at_most_five_times_a_second() -> None:
    line = ScriptedLine(*[(b"?", b"<Run|MPos:0.000,0.000,0.000|FS:0,0>\r\n")] * 11)
    stage = Grbl(line, TRAVEL)
    for _ in range(11):
        stage.position_m()
    assert line.clock.now() >= 1.999


def test_grbl_work_positions_need_their_offset() -> None:
    line = ScriptedLine(
        (b"?", b"<Idle|WPos:1.000,2.000,3.000|FS:0,0>\r\n"),
        (b"?", b"<Idle|WPos:1.000,2.000,3.000|FS:0,0|WCO:-10.000,-10.000,-10.000>\r\n"),
    )
    np.testing.assert_allclose(Grbl(line, TRAVEL).position_m(), [-9e-3, -8e-3, -7e-3])


def test_grbl_says_no() -> None:
    stage = Grbl(ScriptedLine((b"$I\n", b"error:9\r\n")), TRAVEL)
    with pytest.raises(Refusal, match="error:9"):
        stage.identify()
    stage = Grbl(ScriptedLine((b"?", b"ALARM:1\r\n")), TRAVEL)
    stage.trusted = True
    with pytest.raises(Refusal, match="ALARM:1"):
        stage.moving()
    assert not stage.trusted


def test_grbl_that_restarts_by_itself_is_not_believed() -> None:
    stage = Grbl(ScriptedLine((b"G21 G90 G94\n", b"\r\nGrbl 1.1h ['$' for help]\r\n")), TRAVEL)
    stage.trusted = True
    with pytest.raises(Refusal, match="reset"):
        stage._command("G21 G90 G94")
    assert not stage.trusted


def test_grbl_silent_ends_in_its_time() -> None:
    line = ScriptedLine((b"$I\n", b""), (b"\x18", b""), (b"?", b""))
    with pytest.raises(NoAnswer, match="no answer to a reset"):
        Grbl(line, TRAVEL).identify()
    assert line.clock.now() == pytest.approx(4.0, abs=0.1)


def test_grbl_locked_by_a_limit_switch_is_woken_by_a_reset() -> None:
    line = ScriptedLine((b"$I\n", b""), (b"\x18", BANNER), (b"$I\n", b"[VER:1.1h.20190830:]\r\nok\r\n"))
    assert Grbl(line, TRAVEL).identify() == "GRBL 1.1h.20190830"


def test_grbl_that_did_not_hear_a_reset_is_reset_again_as_soon_as_it_answers() -> None:
    awake = b"<Idle|MPos:0.000,0.000,-5.000|FS:0,0>\r\n"
    line = ScriptedLine(
        (b"\x18", b""),
        (b"?", b""),
        (b"?", awake),
        (b"\x18", BANNER),
        (b"$X\n", b"ok\r\n"),
        (b"G21 G90 G94\n", b"ok\r\n"),
    )
    Grbl(line, TRAVEL).recover()
    assert line.done()
    assert line.clock.now() < 4.0


def test_grbl_that_boots_for_twelve_seconds_is_not_begun_anew_meanwhile() -> None:
    line = ScriptedLine((b"\x18", b""), *[(b"?", b"")] * 2, (b"\x18", b""), *[(b"?", b"")] * 5, (b"\x18", b""))
    line._traffic += [(b"?", b"")] * 11 + [(b"?", BANNER), (b"$X\n", b"ok\r\n"), (b"G21 G90 G94\n", b"ok\r\n")]
    Grbl(line, TRAVEL).recover()
    assert line.done()


def test_grbl_that_restarts_when_its_port_is_opened_is_asked_again() -> None:
    line = ScriptedLine((b"$I\n", b"\r\nGrbl 1.1h ['$' for help]\r\n"), (b"$I\n", b"[VER:1.1h.20190830:]\r\nok\r\n"))
    assert Grbl(line, TRAVEL).identify() == "GRBL 1.1h.20190830"


def test_stages_stay_in_their_travel() -> None:
    for stage in (Grbl(ScriptedLine(), TRAVEL), Marlin(ScriptedLine(), UPWARD)):
        with pytest.raises(LimitExceeded, match="travel"):
            stage.start_move(np.array([0.0, 0.0, 0.3]), 1e-3)


def test_grbl_other_firmware_is_refused() -> None:
    with pytest.raises(Refusal, match="no GRBL"):
        Grbl(ScriptedLine((b"$I\n", b"[VER:0.9j:]\r\nok\r\n")), TRAVEL).identify()


# -------------------------------------------------------------------------------------------------------- Marlin


def test_marlin_checksum_is_the_exclusive_or() -> None:
    # From a public log of a host talking to Marlin: "N0 M110 N0*125", "N1 M105*38".
    assert numbered(0, "M110 N0") == b"N0 M110 N0*125\n"
    assert numbered(1, "M105") == b"N1 M105*38\n"


def test_marlin_sends_again_what_came_damaged() -> None:
    line = ScriptedLine(
        (numbered(1, "M114"), b"Error:checksum mismatch, Last Line: 0\r\nResend: 1\r\nok\r\n"),
        (numbered(1, "M114"), b"X:1.00 Y:2.00 Z:3.00 E:0.00 Count X:80 Y:160 Z:1200\r\nok\r\n"),
    )
    np.testing.assert_allclose(Marlin(line, UPWARD).position_m(), [1e-3, 2e-3, 3e-3])
    assert line.done()


def test_marlin_lost_ok_is_found_again() -> None:
    line = ScriptedLine(
        (numbered(1, "M999"), b""),
        (
            numbered(1, "M999"),
            b"Error:Line Number is not Last Line Number+1, Last Line: 1\r\nResend: 2\r\nok\r\n",
        ),
    )
    assert Marlin(line, UPWARD)._command("M999") == ["Error:Line Number is not Last Line Number+1, Last Line: 1"]


def test_marlin_busy_is_waited_for_but_not_for_ever() -> None:
    line = ScriptedLine(
        (numbered(1, "G28"), b"echo:busy: processing\r\necho:busy: processing\r\nok\r\n"),
        (numbered(2, "G21"), b"ok\r\n"),
        (numbered(3, "G90"), b"ok\r\n"),
    )
    stage = Marlin(line, UPWARD)
    stage.home()
    assert stage.trusted
    stuck = Marlin(ScriptedLine(*[(numbered(1, "M400"), b"")] * 20), UPWARD)
    with pytest.raises(NoAnswer):
        stuck._command("M400")


def test_marlin_that_stopped_is_not_believed() -> None:
    stage = Marlin(ScriptedLine((numbered(1, "M115"), b"Error:Printer halted. kill() called!\r\n")), UPWARD)
    stage.trusted = True
    with pytest.raises(Refusal, match="halted"):
        stage._command("M115")
    assert not stage.trusted


# ---------------------------------------------------------------------------------------------------- load cells


def test_mark10_asks_and_reads() -> None:
    cell = Mark10(ScriptedLine((b"?\r", b"4.285 N\r\n"), (b"?\r", b"-18.78 lbF\r\n")))
    assert cell.force(1.0).force_n == 4.285
    assert cell.force(1.0).force_n == pytest.approx(-83.5376, abs=1e-3)


def test_mark10_asks_again_after_noise_and_gives_up_in_time() -> None:
    line = ScriptedLine((b"?\r", b"4.2\xff85 N\r\n"), (b"?\r", b"4.285 N\r\n"))
    cell = Mark10(line)
    assert cell.force(1.0).force_n == 4.285
    assert cell.garbled == 1
    silent = ScriptedLine(*[(b"?\r", b"")] * 20)
    with pytest.raises(NoAnswer):
        Mark10(silent).force(1.0)
    assert silent.clock.now() == pytest.approx(1.0, abs=0.35)


def test_mark10_error_codes() -> None:
    with pytest.raises(Refusal, match=r"\*10"):
        Mark10(ScriptedLine((b"?\r", b"*10\r\n"))).force(1.0)


@pytest.mark.parametrize(
    ("layout", "text", "newton"),
    [
        ("counts", b"101234\r\n", 1.0),
        ("plain", b"-1.250\r\n", -1.25),
        ("average", b"one reading:\t1.5\t| average:\t1.4\r\n", 1.5),
        ("reading", b"Reading: 0.500 kg calibration_factor: -7050.00\r\n", 4.903325),
        ("openscale", b"1523,0.25,lbs,23.12,24.00,\r\n", 1.11205),
    ],
)
def test_hx711_layouts(layout: str, text: bytes, newton: float) -> None:
    line = ScriptedLine(unasked=b"tail of a line\r\n" + text)
    cell = hx711(line, layout, "N", 1 / 20_000, 81_234)
    assert cell.force(1.0).force_n == pytest.approx(newton, abs=1e-4)


def test_futek_reads_value_and_unit() -> None:
    cell = futek(ScriptedLine(unasked=b"\r\n5.0\r\n-101.972 g\r\nnoise\r\n"), compression=-1.0)
    assert cell.force(1.0).force_n == pytest.approx(1.0, abs=1e-3)


def test_a_line_joined_in_the_middle_is_not_a_sample() -> None:
    cell = futek(ScriptedLine(unasked=b"1.972 g\r\n101.972 g\r\n"))
    assert cell.force(1.0).force_n == pytest.approx(1.0, abs=1e-3)


# --------------------------------------------------------------------------------------------------- ERT readers


def scan_frame(sequence: int, shape: tuple[int, int] = (3, 2), flags: int = 0, start_us: int = 0) -> bytes:
    count = np.arange(shape[0] * shape[1], dtype=np.int32).reshape(shape) - 2 + sequence
    return encode(Frame(Type.SCAN, flags, sequence, start_us, 400_000, *shape, scan_payload(count, count == 1)))


def identity(**changes: object) -> bytes:
    fields: dict[str, object] = {"name": "reader", "serial": "7", "injections": 3, "readings": 2}
    fields |= {"volts_per_count": 0.5, "limit_v": 8.0, "scan_s": 0.4, "next": 0} | changes
    return encode(Frame(Type.IDENTITY, 0, 0, 0, 0, 0, 0, json.dumps(fields).encode()))


def test_link_scans_by_number() -> None:
    line = ScriptedLine((b"I\n", identity()), (b"S 0\n", scan_frame(0)), (b"S 1\n", scan_frame(1)))
    reader = ErtLink(line, (3, 2))
    for sequence in range(2):
        reader.start()
        scan = reader.finish(2.0)
        assert (scan.sequence, scan.lost) == (sequence, 0)
        np.testing.assert_array_equal(scan.voltage_v, 0.5 * scan.count)
        np.testing.assert_array_equal(scan.saturated, scan.count == 1)


def test_link_asks_again_for_a_damaged_scan() -> None:
    damaged = bytearray(scan_frame(0))
    damaged[40] ^= 4
    line = ScriptedLine((b"I\n", identity()), (b"S 0\n", bytes(damaged)), (b"S 0\n", scan_frame(0)))
    reader = ErtLink(line, (3, 2))
    reader.start()
    assert reader.finish(2.0).sequence == 0
    assert reader.repeated == 1
    assert line.clock.now() < 0.5


def test_link_reports_what_was_lost() -> None:
    line = ScriptedLine(
        (b"I\n", identity()), *[(b"S 0\n", b"")] * 4, (b"I\n", identity(next=1)),
        (b"S 1\n", scan_frame(1, flags=Flag.DROPPED)),
    )  # fmt: skip
    reader = ErtLink(line, (3, 2))
    reader.start()
    with pytest.raises(NoAnswer):
        reader.finish(5.0)
    reader.start()
    assert reader.finish(2.0).lost == 2


def test_link_refuses_another_shape_and_bad_scales() -> None:
    with pytest.raises(Refusal, match="scans 4x2"):
        ErtLink(ScriptedLine((b"I\n", identity(injections=4))), (3, 2)).identify()
    for absurd in (identity(volts_per_count=0), identity(limit_v="x"), identity(next=-1)):
        with pytest.raises(Refusal, match="no reader"):
            ErtLink(ScriptedLine(*[(b"I\n", absurd)] * 3), (3, 2)).identify()


def test_link_keeps_the_scans_own_time() -> None:
    """The device's clock tells when a scan began, however late it arrived."""
    line = ScriptedLine((b"I\n", identity()), (b"S 0\n", scan_frame(0, start_us=5_000_000)))
    reader = ErtLink(line, (3, 2))
    reader.start()
    line.clock.sleep(0.45)
    first = reader.finish(2.0)
    assert 0.0 <= first.time_s <= 0.05
    line.clock.sleep(1.0 - line.clock.now())
    line._traffic = [(b"S 1\n", scan_frame(1, start_us=6_010_000))]
    reader.start()
    line.clock.sleep(1.9)
    assert reader.finish(2.0).time_s == pytest.approx(first.time_s + 1.01, abs=0.02)


def test_text_readers_want_a_second_opinion() -> None:
    good, wrong = b"1.0000,2.0000,3.0000,4.0000\n", b"1.0000,9.0000,3.0000,4.0000\n"
    line = ScriptedLine(unasked=b"")
    reader = eit_kit(line, 2)
    reader.start()
    line.say(b"tail\n" + wrong + good + b"1.0000,2.0000\n" + good)
    scan = reader.finish(2.0)
    np.testing.assert_allclose(scan.voltage_v, [[1, 2], [3, 4]])
    assert scan.lost == 2


def test_spectra_is_set_going_and_read() -> None:
    text = b"magnitudes : 1.5,2.5,\n"
    line = ScriptedLine((b"c\n", text))
    reader = spectra(line, (1, 2))
    assert reader.identify() == "OpenEIT Spectra"
    reader.start()
    line.say(b"\n" + text * 3)
    np.testing.assert_allclose(reader.finish(1.0).voltage_v, [[1.5, 2.5]])


def test_lost_contact_comes_through() -> None:
    for make in (
        lambda line: Grbl(line, TRAVEL).position_m(),
        lambda line: Mark10(line).force(1.0),
        lambda line: futek(line).force(1.0),
        lambda line: eit_kit(line, 2).finish(1.0),
    ):
        line = ScriptedLine(*[(b"?", b"")] * 1, *[(b"?\r", b"")] * 1)
        line._traffic = [(b"?", b"")] if make.__code__.co_names[0] == "Grbl" else [(b"?\r", b"")]
        line.lost = True
        with pytest.raises(LostContact):
            make(line)

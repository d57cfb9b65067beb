"""From a rig's configuration to an opened bench, real or virtual."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ertskin.errors import UserError
from ertskin.hardware.clock import Clock, SystemClock
from ertskin.hardware.compressometer import read_specimen_table
from ertskin.hardware.description import DescriptionError, protocol_of, sensor_of
from ertskin.hardware.instrument import ErtReader
from ertskin.hardware.recording import Specimen
from ertskin.hardware.rig import Rig, RigError, open_reader, open_rig
from ertskin.hardware.specimen_run import SpecimenSetup
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor
from ertskin.settings import check_limits, checked

if TYPE_CHECKING:
    from ertskin.bench.hands import Hands
    from ertskin.hardware.virtual.bench.truth import Truth
    from ertskin.hardware.virtual.rig import VirtualBench


@dataclass(frozen=True)
class OpenBench:
    """A rig, and the specimen test that goes with it or how to make it.

    On the virtual bench alone: what is hidden in the skin, and hands to do what a person at a real one is asked to.
    """

    rig: Rig
    specimen: Specimen | None
    setup: SpecimenSetup | None
    truth: Truth | None = None
    hands: Hands | None = None


def described(config: Mapping[str, Any]) -> tuple[Sensor, Protocol]:
    """The sensor and the scan of a configuration's ``sensor``; raises ``UserError``."""
    try:
        sensor = sensor_of(config)
        return sensor, protocol_of(config["protocol"], sensor.electrodes)
    except DescriptionError as error:
        raise UserError(str(error)) from None
    except KeyError:
        raise UserError("sensor: has no protocol") from None


@contextmanager
def opened(
    fields: Mapping[str, Any],
    sensor: Sensor,
    protocol: Protocol,
    start_s: float = 0.0,
    real_time: bool = False,
    purpose: str = "live",
) -> Iterator[OpenBench]:
    """The bench of a configuration's ``rig``, closed again at the end.

    For a virtual one: ``start_s`` is where its clock begins, for a recording gone on with; in ``real_time`` it keeps to
    the machine's instead of jumping over every wait; runs for different ``purpose`` have noise of their own. Raises
    ``UserError`` for a description that makes no sense, ``LostContact`` where a port can't be opened.
    """
    table = Path(fields["specimen"]) if fields.get("specimen") else None
    try:
        if fields.get("virtual"):
            with _virtual(fields, sensor, protocol, start_s, real_time, purpose) as bench:
                yield bench
            return
        rig = open_rig(fields, sensor, protocol)
    except RigError as error:
        raise UserError(str(error)) from None
    try:
        setup = SpecimenSetup(**fields["specimen_run"]) if fields.get("specimen_run") else None
        yield OpenBench(rig, None if table is None else read_specimen_table(table), setup)
    finally:
        rig.close()


@contextmanager
def opened_reader(fields: Mapping[str, Any], protocol: Protocol) -> Iterator[ErtReader]:
    """A real rig's reader alone, which is all it takes to watch a skin; raises as ``opened``."""
    try:
        reader = open_reader(fields, SystemClock(), protocol.shape)
    except RigError as error:
        raise UserError(str(error)) from None
    try:
        yield reader
    finally:
        reader.close()


@contextmanager
def ports(fields: Mapping[str, Any], sensor: Sensor, protocol: Protocol) -> Iterator[tuple[Mapping[str, Any], Clock]]:
    """A rig's description and clock with nothing opened yet; a virtual one's instruments are emulated meanwhile."""
    if not fields.get("virtual"):
        yield fields, SystemClock()
        return
    with _emulated(fields, sensor, protocol) as (bench, _):
        yield bench.fields, bench.clock


@contextmanager
def _virtual(
    fields: Mapping[str, Any], sensor: Sensor, protocol: Protocol, start_s: float, real_time: bool, purpose: str
) -> Iterator[OpenBench]:
    from ertskin.hardware.virtual.rig import PLATE_M2

    with _emulated(fields, sensor, protocol, start_s, real_time, purpose) as (bench, truth):
        setup = SpecimenSetup(**{"area_m2": PLATE_M2, **(fields.get("specimen_run") or {})})
        rig = bench.open()
        try:
            yield OpenBench(rig, None, setup, truth, bench)
        finally:
            rig.close()


@contextmanager
def _emulated(
    fields: Mapping[str, Any],
    sensor: Sensor,
    protocol: Protocol,
    start_s: float = 0.0,
    real_time: bool = False,
    purpose: str = "live",
) -> Iterator[tuple[VirtualBench, Truth]]:
    from ertskin.hardware.virtual.bench.live import LiveSkin
    from ertskin.hardware.virtual.bench.truth import Noise, draw_truth
    from ertskin.hardware.virtual.rig import virtual_bench
    from ertskin.hardware.virtual.serving import Server
    from ertskin.hardware.virtual.specimen import BenchSpecimen

    hidden = {name: float(strength) for name, strength in (fields.get("effects") or {}).items()}
    noise = checked(Noise, fields.get("noise") or {}, "rig.noise")
    for name, amplitude in vars(noise).items():
        check_limits(amplitude, {"least": 0.0}, f"rig.noise.{name}")
    try:
        truth = draw_truth(sensor, int(fields["seed"]), hidden, noise)
    except KeyError as error:
        raise UserError(f"rig: {error.args[0]}") from None
    bench = virtual_bench(
        LiveSkin(truth, sensor, protocol, purpose=f"{purpose} from {start_s:.0f} s"),
        fields["stage"]["driver"],
        fields["load_cell"]["driver"],
        fields["ert_reader"]["driver"],
        block_stiffness_n_per_m=truth.support_n_per_m,
        pair=BenchSpecimen(truth),
        limits=fields.get("limits"),
        seed=truth.seed,
        start_s=start_s,
        real_time=real_time,
    )
    server = Server([bench.stage, bench.load_cell, bench.reader]) if real_time else None
    try:
        yield bench, truth
    finally:
        if server is not None:
            server.close()
        bench.close()

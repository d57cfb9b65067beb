"""Show the force map of a skin as it is touched.

Reads a rig's ERT reader, or plays a recording, through a trained network: on a page of this machine alone, or with
``stream=true`` as one JSON object a line in the shapes of ROS 2 messages.
"""

from __future__ import annotations

import sys
import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ertskin.hardware.failure import InstrumentError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from omegaconf import DictConfig

    from ertskin.hardware.instrument import Scan
    from ertskin.hardware.recording import Recording
    from ertskin.live.predictor import Predictor
    from ertskin.physics.protocol import Protocol
    from ertskin.physics.sensor import Sensor


def run(config: DictConfig) -> None:
    """Watch until interrupted, or until a recording played is through."""
    from ertskin.errors import JobFailed, UserError
    from ertskin.hardware.recording import read_recording

    # Refused before what follows loads for seconds.
    recording = None if config.recording is None else read_recording(Path(config.recording))

    from ertskin.live.keeping import Keeper
    from ertskin.live.message import fault_of, line_of, message_of
    from ertskin.live.server import Channel, LiveServer
    from ertskin.live.session import LEFT, Session
    from ertskin.live.watch import Watch

    predictor = _predictor(_network(config))
    ending, channel = threading.Event(), Channel()

    def out(message: dict[str, object]) -> None:
        line = line_of(message)
        channel.send(line)
        if config.stream:
            print(line, flush=True)

    def failed(text: str) -> None:
        print(f"ertskin: {text}", file=sys.stderr)
        out(fault_of(text, time.time()))

    with ExitStack() as stack:
        stack.callback(ending.set)
        source = _watched(config, stack, ending, failed) if recording is None else _played(config, recording, ending)
        if source.protocol.shape != predictor.kind.shape:
            found, wanted = ("x".join(map(str, shape)) for shape in (source.protocol.shape, predictor.kind.shape))
            raise UserError(f"the reader scans {found}, the network was trained on {wanted}")
        watch = None if predictor.monitor is None else Watch(predictor.monitor, source.protocol)
        if watch is None and config.follow:
            print("ertskin: this network does not know its resting skin: zeroing alone", file=sys.stderr)
        session = Session(predictor, source.zero_scans, source.noise_v, watch if config.follow else None)
        left = False
        keeper = Keeper(Path(config.folder), source.name, source.sensor, source.protocol)
        stack.callback(keeper.end)
        if not config.stream:
            server = LiveServer(channel, int(config.port), {"/zero": _zeroing(session), "/record": keeper.turn})
            stack.callback(server.close)
            print(f"live: {server.url}   (Ctrl-C ends it)", flush=True)
        try:
            for scan in source.scans:
                frame = session.see(scan)
                keeper.keep(scan, frame)
                if frame.left and not left:
                    print(f"ertskin: {LEFT}", file=sys.stderr)
                left = frame.left
                out(message_of(frame, predictor.kind.taxel_m, source.epoch_s, keeper.frames))
                session.rehearse()
        except InstrumentError as error:
            raise JobFailed(str(error)) from None


def _zeroing(session: Any) -> Any:
    def zero() -> str:
        session.zero()
        return "zeroing: do not touch"

    return zero


def _network(config: DictConfig) -> Path:
    """The network that is named, else that of the training which ended last."""
    if config.network is not None:
        return Path(config.network)
    from ertskin.training.finished import latest_job

    latest = latest_job(Path(config.trained))
    print(f"network: {latest}", file=sys.stderr, flush=True)
    return latest


def _predictor(path: Path) -> Predictor:
    """The network of an ONNX file, or of a trained one, exported beside it first."""
    from ertskin.live.predictor import Predictor

    if path.is_dir():
        path = path / "model.pt"
    if path.suffix != ".onnx" and path.is_file():
        from ertskin.live.export import export_onnx
        from ertskin.models.reconstruction import Reconstruction

        exported = path.with_suffix(".onnx")
        if not exported.is_file() or exported.stat().st_mtime < path.stat().st_mtime:
            export_onnx(Reconstruction.load(path), exported)
        path = exported
    return Predictor(path)


@dataclass(frozen=True)
class Source:
    """Where scans come from, and what is known beforehand: ``noise_v`` of a reading, 0 for nothing; ``epoch_s``, the
    system's time at the zero of the scans' clock."""

    name: str
    scans: Iterator[Scan]
    sensor: Sensor | None
    protocol: Protocol
    zero_scans: int
    noise_v: float
    epoch_s: float


def _played(config: DictConfig, recording: Recording, ending: threading.Event) -> Source:
    """A recording; its rest frames lie between presses, so the first of them alone is the baseline."""
    import numpy as np

    from ertskin.errors import UserError
    from ertskin.live.session import noise_of
    from ertskin.live.sources import scans_of_recording
    from ertskin.physics.history import Phase
    from ertskin.physics.spikes import completed

    frames, protocol = recording.frames, recording.protocol
    if frames is None or protocol is None:
        raise UserError(f"{config.recording}: holds no scans to play")
    rest = completed(protocol, frames.voltage_v[frames.history.phase == Phase.REST][:8].astype(float))
    rest = rest[np.isfinite(rest).all(axis=(1, 2))]
    noise = noise_of(rest) if len(rest) > 1 else 0.0
    scans = scans_of_recording(frames, protocol, float(config.speed), ending)
    return Source("played", scans, recording.sensor, protocol, 1, noise, 0.0)


def _watched(config: DictConfig, stack: ExitStack, ending: threading.Event, failed: Callable[[str], None]) -> Source:
    """A rig's reader; on the virtual bench somebody presses here and there."""
    from omegaconf import OmegaConf

    from ertskin.bench.opening import described, opened, opened_reader
    from ertskin.live.sources import scans_of_reader

    fields = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    sensor, protocol = described(fields["sensor"])
    if fields["rig"].get("virtual"):
        bench = stack.enter_context(opened(fields["rig"], sensor, protocol, real_time=True))
        reader = bench.rig.reader
        if config.hand and bench.truth is not None:
            from ertskin.live.hand import Hand

            hand = Hand(bench.rig, bench.truth.seed, ending)
            stack.callback(hand.join)
            stack.callback(ending.set)
            hand.start((int(config.zero_scans) + 1) * 0.5)
    else:
        reader = stack.enter_context(opened_reader(fields["rig"], protocol))
    scans = scans_of_reader(reader, protocol, failed, ending)
    epoch_s = time.time() - time.monotonic()
    return Source(str(fields["rig"]["name"]), scans, sensor, protocol, int(config.zero_scans), 0.0, epoch_s)

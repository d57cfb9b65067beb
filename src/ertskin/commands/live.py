"""Show the force map of a skin as it is touched.

Reads a rig's ERT reader, or plays a recording, through a trained network: on a page of this machine alone, or with
``stream=true`` as one JSON object a line in the shapes of ROS 2 messages.
"""

from __future__ import annotations

import sys
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from hardware.failure import InstrumentError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from omegaconf import DictConfig

    from ertskin.live.predictor import Predictor
    from hardware.instrument import Scan
    from physics.protocol import Protocol
    from physics.sensor import Sensor


def run(config: DictConfig) -> None:
    """Watch until interrupted, or until a recording played is through."""
    from ertskin.errors import JobFailed, UserError
    from ertskin.live.keeping import Keeper
    from ertskin.live.message import line_of
    from ertskin.live.server import Channel, LiveServer
    from ertskin.live.session import Session

    predictor = _predictor(Path(config.network))
    ending = threading.Event()
    with ExitStack() as stack:
        stack.callback(ending.set)
        scans, sensor, protocol = _source(config, stack, ending)
        if protocol.shape != predictor.kind.shape:
            found, wanted = ("x".join(map(str, shape)) for shape in (protocol.shape, predictor.kind.shape))
            raise UserError(f"the reader scans {found}, the network was trained on {wanted}")
        session = Session(predictor, 1 if config.recording is not None else int(config.zero_scans))
        keeper = Keeper(Path(config.folder), str(config.get("rig", {}).get("name", "played")), sensor, protocol)
        stack.callback(keeper.end)
        channel = Channel()
        if not config.stream:
            server = LiveServer(channel, int(config.port), {"/zero": _zeroing(session), "/record": keeper.turn})
            stack.callback(server.close)
            print(f"live: {server.url}   (Ctrl-C ends it)", flush=True)
        try:
            for scan in scans:
                frame = session.see(scan)
                keeper.keep(scan, frame)
                line = line_of(frame, predictor.kind.taxel_m)
                channel.send(line)
                if config.stream:
                    print(line, flush=True)
        except InstrumentError as error:
            raise JobFailed(str(error)) from None


def _zeroing(session: Any) -> Any:
    def zero() -> str:
        session.zero()
        return "zeroing: do not touch"

    return zero


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


def _source(
    config: DictConfig, stack: ExitStack, ending: threading.Event
) -> tuple[Iterator[Scan], Sensor | None, Protocol]:
    from omegaconf import OmegaConf

    from ertskin.errors import UserError
    from ertskin.live.sources import scans_of_recording, scans_of_rig

    if config.recording is not None:
        from hardware.recording import read_recording

        recording = read_recording(Path(config.recording))
        if recording.frames is None or recording.protocol is None:
            raise UserError(f"{config.recording}: holds no scans to play")
        scans = scans_of_recording(recording.frames, recording.protocol, float(config.speed), ending)
        return scans, recording.sensor, recording.protocol
    from ertskin.bench.opening import described, opened

    fields = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    sensor, protocol = described(fields["sensor"])
    bench = stack.enter_context(opened(fields["rig"], sensor, protocol, real_time=True))
    if bench.truth is not None and config.hand:
        from ertskin.live.hand import Hand

        hand = Hand(bench.rig, bench.truth.seed, ending)
        stack.callback(hand.join)
        stack.callback(ending.set)
        hand.start((int(config.zero_scans) + 1) * 0.5)
    return scans_of_rig(bench.rig, lambda text: print(f"ertskin: {text}", file=sys.stderr), ending), sensor, protocol

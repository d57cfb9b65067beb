"""Tanks simulated by a solver of their own: linear elements on a polar mesh drawn to any star-shaped outline.

Nothing of ``ertskin.physics.conduction`` is used. A tank has what real ones have: electrodes glued by hand, water of
uneven depth, electrodes of uneven width and contact, channels of uneven gain, noise, and what is not two-dimensional
(an error of every reading that keeps reciprocity).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

from ertskin.hardware.recording import Frames, Recording
from ertskin.physics.history import History
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

ELECTRODES = 16
RADIUS_M = 0.15
AROUND, RINGS = 480, 36
SHEET_OHM_SQ = 100.0
CURRENT_A = 1e-3
WIDTH = 0.067
"""Electrodes' width over the radius."""


@dataclass(frozen=True)
class Fault:
    """Something wrong besides: an electrode whose potential is read wrong, or something in the water.

    ``gain`` less one and ``offset`` over the readings' rms, of the potential of ``electrode``, in the readings that
    are differences of channels; ``inside`` (x, y, radius) over the tank's and ``contrast`` of the conductance there.
    """

    electrode: int = -1
    gain: float = 0.0
    offset: float = 0.0
    inside: tuple[float, float, float] = (0.0, 0.0, 0.0)
    contrast: float = 1.0


@dataclass(frozen=True)
class Tank:
    """A tank that its file calls round: the outline is R exp(``squeeze`` cos k(theta - ``turn``)), ``lobes`` k.

    The rest are standard deviations over the nominal, drawn by ``seed``: ``placed`` of the places along the wall over
    the radius, ``depth`` of slopes and curvatures of the water's depth, ``uneven`` of widths and contacts, ``gain`` of
    channels and currents, ``noise`` of readings over their rms, ``flat`` of what two dimensions leave out.
    """

    squeeze: float = 0.0
    turn: float = 0.0
    lobes: int = 2
    placed: float = 0.0
    depth: float = 0.0
    uneven: float = 0.0
    gain: float = 0.0
    noise: float = 1e-4
    flat: float = 0.0
    seed: int = 0
    fault: Fault = Fault()
    moved: tuple[tuple[int, float], ...] = ()
    """Single electrodes moved along the wall, over the radius."""

    def outline(self, angle: Array) -> Array:
        """(n,) radius of the outline in metre at angles (n,)."""
        return np.asarray(RADIUS_M * np.exp(self.squeeze * np.cos(self.lobes * (angle - self.turn))))

    def places(self) -> Array:
        """(16,) angles of the electrodes, evenly spaced along the wall but for the hand that glued them."""
        fine = np.linspace(0, 2 * np.pi, 7201)
        point = self.outline(fine)[:, None] * np.stack([np.cos(fine), np.sin(fine)], axis=1)
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(point, axis=0), axis=1))])
        shift = self.placed * np.random.default_rng([self.seed, 1]).standard_normal(ELECTRODES)
        for electrode, by in self.moved:
            shift[electrode] += by
        wanted = arc[-1] * np.arange(ELECTRODES) / ELECTRODES + RADIUS_M * shift
        return np.asarray(np.interp(np.mod(wanted, arc[-1]), arc, fine))

    def disk_shifts(self) -> Array:
        """(16,) angles by which the electrodes' images on the disk differ from even ones, the group of the disk's maps
        onto itself taken off: all that readings can tell of the places."""
        return beyond_disk_maps(disk_angles(self.outline, self.places()) - even_angles())

    def recording(self, frames: int = 2) -> Recording:
        """Frames of this tank, with a sensor group that says round."""
        protocol = adjacent()
        clean = self.readings(protocol)
        size = float(np.sqrt(np.mean(clean[protocol.taken] ** 2)))
        noise = np.random.default_rng([self.seed, 5]).standard_normal((frames, *clean.shape))
        voltage = protocol.gapped(clean + self.noise * size * noise).astype(np.float32)
        nothing = np.zeros((frames, 0))
        history = History(
            np.arange(float(frames)),
            np.arange(frames),
            np.zeros(frames, np.uint8),
            np.zeros((frames, 0, 2)),
            nothing,
            nothing,
        )
        return Recording("simulated tank", "", "", round_sensor(), protocol, Frames(voltage, history))

    def readings(self, protocol: Protocol) -> Array:
        """(16,16) readings in volt."""
        draw = np.random.default_rng([self.seed, 2])
        potential = protocol.injection_current_a @ self.transfer_ohm()
        reads = np.einsum("kml,kl->km", protocol.measurement, potential)
        # Neighbours drive and are read alike, so that a symmetric factor keeps reciprocity.
        flat = np.triu(draw.standard_normal((ELECTRODES, ELECTRODES)))
        reads *= 1 + self.flat * (flat + np.triu(flat, 1).T)
        reads *= (1 + self.gain * draw.standard_normal(ELECTRODES))[:, None]
        reads *= 1 + self.gain * draw.standard_normal(ELECTRODES)
        if self.fault.electrode >= 0:
            size = float(np.sqrt(np.mean(reads[protocol.taken] ** 2)))
            wrong = np.zeros_like(potential)
            wrong[:, self.fault.electrode] = self.fault.offset * size
            reads[:, self.fault.electrode] *= 1 + self.fault.gain
            reads += np.einsum("kml,kl->km", protocol.measurement, wrong)
        return np.asarray(reads * protocol.taken)

    def transfer_ohm(self) -> Array:
        """(16,16) potentials of the electrodes for one ampere into each, complete electrode model."""
        node, triangle = polar_mesh(self.outline)
        conductance = self._conductance_s(node[triangle].mean(axis=1))
        return solved(node, triangle, conductance, *self._electrodes())

    def _conductance_s(self, point_m: Array) -> Array:
        x, y = point_m.T / RADIUS_M
        draw = np.random.default_rng([self.seed, 3]).standard_normal(5)
        depth = np.exp(self.depth * (np.stack([x, y, x * y, x**2 - y**2, x**2 + y**2]).T @ draw))
        at = self.fault.inside
        inside = np.hypot(x - at[0], y - at[1]) < at[2]
        return np.asarray(depth * np.where(inside, self.fault.contrast, 1.0) / SHEET_OHM_SQ)

    def _electrodes(self) -> tuple[Array, Array, Array]:
        draw = np.random.default_rng([self.seed, 4])
        half = 0.5 * WIDTH * np.exp(self.uneven * draw.standard_normal(ELECTRODES))
        contact = 0.2 * np.exp(2 * self.uneven * draw.standard_normal(ELECTRODES))
        return self.places(), half, contact


def even_angles() -> Array:
    """(16,) where the file puts the electrodes."""
    return np.asarray(2 * np.pi * np.arange(ELECTRODES) / ELECTRODES)


@cache
def round_sensor() -> Sensor:
    """The sensor group: a circle with evenly spaced electrodes."""
    around = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    outline = RADIUS_M * np.stack([np.cos(around), np.sin(around)], axis=1)
    ends = [even_angles() - 0.5 * WIDTH, even_angles() + 0.5 * WIDTH]
    edge = np.stack([RADIUS_M * np.stack([np.cos(a), np.sin(a)], axis=1) for a in ends], axis=1)
    return Sensor(outline, electrode_edge_m=edge)


def adjacent() -> Protocol:
    """Neighbouring injections and readings, driven electrodes not read."""
    number = np.arange(ELECTRODES)
    reads = np.stack([(number + 1) % ELECTRODES, number], axis=1)
    measured = ~(reads[None, :, :, None] == reads[:, None, None, :]).any(axis=(2, 3))
    current = CURRENT_A * (np.eye(ELECTRODES) - np.eye(ELECTRODES)[reads[:, 0]])
    return Protocol.differences(current, reads, measured=measured)


def polar_mesh(outline) -> tuple[Array, NDArray[np.intp]]:  # type: ignore[no-untyped-def]
    """Nodes (n,2) in metre and triangles (m,3): rings that get closer towards the rim, and the middle."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    share = 1 - (1 - np.arange(1, RINGS + 1) / RINGS) ** 1.6
    rim = outline(angle)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    node = np.concatenate([np.zeros((1, 2)), (share[:, None, None] * rim).reshape(-1, 2)])
    k, following = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    triangles = [np.stack([np.zeros(AROUND, dtype=int), 1 + k, 1 + following], axis=1)]
    for ring in range(RINGS - 1):
        inner, outer = 1 + ring * AROUND, 1 + (ring + 1) * AROUND
        triangles.append(np.stack([inner + k, outer + k, outer + following], axis=1))
        triangles.append(np.stack([inner + k, outer + following, inner + following], axis=1))
    return node, np.concatenate(triangles).astype(np.intp)


def solved(
    node: Array, triangle: NDArray[np.intp], conductance: Array, place: Array, half: Array, contact_ohm_m: Array
) -> Array:
    """(16,16) potentials of electrodes at angles ``place``, ``half`` their widths over the radius, for unit currents.

    Electrodes may cover an edge of the rim in part; the mean of the electrodes' potentials is nought.
    """
    corner = node[triangle]
    edge = np.roll(corner, -1, axis=1) - np.roll(corner, -2, axis=1)
    area = 0.5 * np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    local = np.einsum("tid,tjd->tij", edge, edge) * (conductance / (4 * area))[:, None, None]
    row, column = np.repeat(triangle, 3, axis=1).ravel(), np.tile(triangle, 3).ravel()
    stiffness = coo_matrix((local.ravel(), (row, column)), shape=(len(node), len(node))).tocsc()
    first = len(node) - AROUND
    rim = first + np.arange(AROUND)
    following = first + (np.arange(AROUND) + 1) % AROUND
    length = np.linalg.norm(node[following] - node[rim], axis=1)
    step = 2 * np.pi / AROUND
    middle = step * (np.arange(AROUND) + 0.5)
    radius = np.linalg.norm(0.5 * (node[following] + node[rim]), axis=1)
    reach = half[:, None] * RADIUS_M / radius * (radius * step / length)
    away = np.abs(np.angle(np.exp(1j * (middle - place[:, None]))))
    covered = np.clip((reach + 0.5 * step - away) / step, 0, 1) * length / contact_ohm_m[:, None]
    total = covered.sum(axis=0)
    on = coo_matrix(
        (
            np.concatenate([total / 3, total / 3, total / 6, total / 6]),
            (np.concatenate([rim, following, rim, following]), np.concatenate([rim, following, following, rim])),
        ),
        shape=stiffness.shape,
    ).tocsc()
    couple = np.zeros((ELECTRODES, len(node)))
    np.add.at(couple, (slice(None), rim), -covered / 2)
    np.add.at(couple, (slice(None), following), -covered / 2)
    self_s = np.diag(covered.sum(axis=1))
    ground = 1e-6 * self_s.mean()
    matrix = bmat([[stiffness + on, csc_matrix(couple.T)], [csc_matrix(couple), csc_matrix(self_s + ground)]]).tocsc()
    right = np.zeros((matrix.shape[0], ELECTRODES))
    right[len(node) :] = np.eye(ELECTRODES) - 1 / ELECTRODES
    potential = splu(matrix).solve(right)[len(node) :]
    return np.asarray(0.5 * (potential + potential.T))


def disk_angles(outline, place: Array) -> Array:  # type: ignore[no-untyped-def]
    """(n,) angles to which a conformal map of the star-shaped inside onto the disk takes the rim's angles ``place``.

    Theodorsen's integral equation, theta(t) = t + K log r(theta(t)), K the conjugation of periodic functions.
    """
    count = 1024
    t = 2 * np.pi * np.arange(count) / count
    theta = t.copy()
    sign = -1j * np.sign(np.fft.fftfreq(count))
    for _ in range(400):
        conjugate = np.real(np.fft.ifft(sign * np.fft.fft(np.log(outline(theta)))))
        theta = 0.5 * theta + 0.5 * (t + conjugate)
    wrapped = np.concatenate([theta - 2 * np.pi, theta, theta + 2 * np.pi])
    return np.asarray(np.interp(place, wrapped, np.concatenate([t - 2 * np.pi, t, t + 2 * np.pi])))


def beyond_disk_maps(shift: Array) -> Array:
    """Shifts (16,) without what a turn or any other map of the disk onto itself does to even places, to first order."""
    angle = even_angles()
    undone = np.linalg.qr(np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1))[0]
    shift = np.angle(np.exp(1j * shift))
    return np.asarray(shift - undone @ (undone.T @ shift))


def hand_made(seed: int, **given: object) -> Tank:
    """A tank as good as they are: how good is drawn too."""
    draw = np.random.default_rng([seed, 0])
    tank = Tank(
        placed=draw.uniform(0, 0.03),
        depth=draw.uniform(0, 0.1),
        uneven=draw.uniform(0, 0.2),
        gain=10 ** draw.uniform(-3.5, -2.5),
        noise=10 ** draw.uniform(-4, -2.5),
        flat=10 ** draw.uniform(-2, -1),
        turn=draw.uniform(0, np.pi),
        seed=seed,
    )
    return replace(tank, **given)  # type: ignore[arg-type]

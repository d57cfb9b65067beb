"""Moduli, law and contacts together from pressed frames: the voltages tell the ratio of the moduli that force and depth
can't, and everything that calibration measured apart may move within its error.

Gauss-Newton on, in units of their standard errors: pressed and resting readings in whitened coordinates, the specimen's
coefficients, and the stiffness from force and depth. The load cell's noise moves a whole frame; it is taken into each
frame's covariance. Interface pressure, law and conduction are differentiated exactly but for the pressure's dependence
on the moduli, which is smooth and differenced.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ertskin.physics.calibration.contact_resistance import ContactFit
from ertskin.physics.calibration.moduli import Groups, ModuliFit, stiffness_gradient, with_moduli
from ertskin.physics.calibration.scan_space import ScanSpace
from ertskin.physics.calibration.specimen import SpecimenFit
from ertskin.physics.conduction.sheet import SheetModel, Solution
from ertskin.physics.mechanics.pressure import InterfacePressure
from ertskin.physics.piezo.polynomial import PiezoPolynomial
from ertskin.physics.protocol import Protocol
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]

_STEP = 0.05
_ROUNDS = 4
_TAIL = 1e-4
"""Derivatives leave out pressures below this part of the largest."""


@dataclass(frozen=True, eq=False)
class PressedFrames:
    """T frames with one contact each: ``voltage_v`` (T,K,M), ``contact_m`` (T,2), ``force_n`` (T,).

    ``rest_v`` (K,M) is the mean of ``rest_frames`` resting frames, ``noise_v`` one reading's noise, ``force_noise_n``
    the load cell's.
    """

    voltage_v: Array
    contact_m: Array
    force_n: Array
    rest_v: Array
    rest_frames: int
    noise_v: float
    force_noise_n: float


@dataclass(frozen=True, eq=False)
class PressedFit:
    """What was fitted, and how well.

    ``moduli_pa`` (n,) with ``log_standard_error`` (n,) and their ``log_covariance``; ``law``;
    ``contact_resistance_ohm`` (L,). ``frame_ratio`` (T,) is each pressed frame's residual rms over the noise, the load
    cell's taken off; ``ratio`` the same over all of them, ``rest_ratio`` that of the resting mean. Near one: nothing is
    left out.
    """

    moduli_pa: Array
    log_covariance: Array
    law: PiezoPolynomial
    contact_resistance_ohm: Array
    frame_ratio: Array
    ratio: float
    rest_ratio: float

    @property
    def log_standard_error(self) -> Array:
        """(n,) relative standard errors of the moduli."""
        return np.sqrt(np.diag(self.log_covariance))


@dataclass(frozen=True, eq=False)
class _State:
    logs: Array
    change: Array
    scale: float
    contact: Array


class PressedProblem:
    """The joint fit of one recording; see the module's text."""

    def __init__(
        self,
        sensor: Sensor,
        groups: Groups,
        model: SheetModel,
        protocol: Protocol,
        specimen: SpecimenFit,
        moduli: ModuliFit,
        contacts: ContactFit,
        frames: PressedFrames,
    ) -> None:
        self.sensor, self.groups, self.model, self.protocol, self.frames = sensor, groups, model, protocol, frames
        self.specimen, self.moduli, self.contacts = specimen, moduli, contacts
        self.space = ScanSpace.of(protocol)
        self._measured = self.space.coordinates(frames.voltage_v)
        self._rest = self.space.coordinates(frames.rest_v)

    def fit(self) -> PressedFit:
        """Iterate to convergence; a handful of frames takes seconds, a few dozen suffice."""
        count = len(self.groups)
        start = np.log(self.moduli.moduli_pa)
        scale = float(np.log(self.contacts.sheet_resistance_ohm_sq / self.specimen.law.zero_ohm_sq))
        state = _State(start, np.zeros(6), scale, np.log(self.contacts.contact_resistance_ohm))
        for _ in range(_ROUNDS):
            residual, jacobian = self._linearised(state)
            normal = jacobian.T @ jacobian
            step = np.linalg.solve(normal, jacobian.T @ residual)
            state = _State(
                state.logs + np.clip(step[:count], -0.7, 0.7),
                state.change + step[count : count + 6],
                state.scale + step[count + 6],
                state.contact + np.clip(step[count + 7 :], -1.0, 1.0),
            )
            if step @ normal @ step < 1e-2:
                break
        residual, jacobian = self._linearised(state)
        covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian))
        pressed = residual[: self._measured.size].reshape(self._measured.shape)
        rest = residual[self._measured.size : self._measured.size + self._rest.size]
        return PressedFit(
            np.exp(state.logs),
            covariance[:count, :count],
            self._law(state),
            np.exp(state.contact),
            np.sqrt((pressed**2).mean(axis=1)),
            float(np.sqrt((pressed**2).mean())),
            float(np.sqrt((rest**2).mean())),
        )

    def _law(self, state: _State) -> PiezoPolynomial:
        law = self.specimen.law.shifted(state.change)
        return law.scaled(law.zero_ohm_sq * np.exp(state.scale))

    def _linearised(self, state: _State) -> tuple[Array, Array]:
        """Residuals and their derivatives (by moduli, coefficients, scale, contacts) over their standard errors."""
        law, contact = self._law(state), np.exp(state.contact)
        fields = self._pressures(state.logs)
        rows = [self._frame(law, contact, state.scale, fields, k) for k in range(len(self._measured))]
        resting = self.model.solve(self.model.uniform(law.zero_ohm_sq), contact)
        share = self.frames.noise_v / np.sqrt(self.frames.rest_frames)
        zero = np.zeros(self.model.weight_m2.shape)
        slope = self._slopes(resting, law, contact, state.scale, zero, np.zeros((len(self.groups), *zero.shape)))
        rows.append(((self._rest - self.space.design @ resting.pair_resistance_ohm) / share, slope / share))
        rows.append(self._specimen_row(state))
        rows.append(self._stiffness_row(state))
        return np.concatenate([r for r, _ in rows]), np.vstack([j for _, j in rows])

    def _pressures(self, logs: Array) -> list[InterfacePressure]:
        """The field at the moduli, and at each modulus up and down by a step."""
        steps = _STEP * np.eye(len(logs))
        every = [logs, *(logs + sign * step for step in steps for sign in (1, -1))]
        return [InterfacePressure.from_transform(with_moduli(self.sensor, self.groups, np.exp(e))) for e in every]

    def _frame(
        self, law: PiezoPolynomial, contact: Array, scale: float, fields: list[InterfacePressure], k: int
    ) -> tuple[Array, Array]:
        offset = self.model.quadrature_m - self.frames.contact_m[k]
        force = float(self.frames.force_n[k])
        unit = fields[0].at(offset)
        pressure = force * unit
        by_log = np.stack(
            [
                force * (fields[1 + 2 * g].at(offset) - fields[2 + 2 * g].at(offset)) / (2 * _STEP)
                for g in range(len(self.groups))
            ]
        )
        resistance = law.sheet_resistance_ohm_sq(pressure)
        solution = self.model.solve(1.0 / resistance, contact)
        residual = (self._measured[k] - self.space.design @ solution.pair_resistance_ohm) / self.frames.noise_v
        slope = self._slopes(solution, law, contact, scale, pressure, by_log) / self.frames.noise_v
        by_force = -law.derivative(pressure) * unit / resistance**2
        wobble = self.space.design @ solution.directional(by_force) * self.frames.force_noise_n / self.frames.noise_v
        return _without(wobble, residual), _without(wobble, slope)

    def _slopes(
        self, solution: Solution, law: PiezoPolynomial, contact: Array, scale: float, pressure: Array, by_log: Array
    ) -> Array:
        """(n, groups + 6 + 1 + L) derivatives in volt of one frame's coordinates.

        Resistances scale together, so the whole sheet in proportion is known from the contacts' derivatives (Euler),
        and what a coefficient does beyond that stays under the contact.
        """
        resistance = law.sheet_resistance_ohm_sq(pressure)
        proportion = resistance / law.zero_ohm_sq
        coefficient = np.exp(scale) * np.moveaxis(law.basis(pressure), -1, 0)
        far = np.exp(scale) * law.basis(np.zeros(1))[0]
        pressed = np.abs(pressure) > _TAIL * np.abs(pressure).max()
        change = np.concatenate([law.derivative(pressure) * by_log, coefficient - far[:, None, None] * proportion])
        local = solution.directional(np.where(pressed, -change / resistance**2, 0.0)).T
        by_contact = solution.jacobian_contact_resistance() * contact
        by_sheet = (solution.pair_resistance_ohm - by_contact.sum(axis=1))[:, None]
        moduli, coefficients = np.split(local, [len(self.groups)], axis=1)
        coefficients = coefficients + by_sheet * far / law.zero_ohm_sq
        return self.space.design @ np.hstack([moduli, coefficients, by_sheet, by_contact])

    def _specimen_row(self, state: _State) -> tuple[Array, Array]:
        root = np.linalg.inv(np.linalg.cholesky(self.specimen.covariance))
        columns = len(self.groups) + 7 + len(state.contact)
        jacobian = np.zeros((6, columns))
        jacobian[:, len(self.groups) : len(self.groups) + 6] = root
        return -root @ state.change, jacobian

    def _stiffness_row(self, state: _State) -> tuple[Array, Array]:
        value, gradient = stiffness_gradient(self.sensor, self.groups, np.exp(state.logs))
        error = self.moduli.stiffness_standard_error_n_per_m / self.moduli.stiffness_n_per_m
        jacobian = np.zeros((1, len(self.groups) + 7 + len(state.contact)))
        jacobian[0, : len(gradient)] = gradient / error
        return np.array([(np.log(self.moduli.stiffness_n_per_m) - value) / error]), jacobian


def _without(wobble: Array, rows: Array) -> Array:
    """Rows (n,...) whitened for a covariance of one plus ``wobble`` (n,) times its transpose."""
    size = float(wobble @ wobble)
    if size == 0:
        return rows
    shrink = (1 - 1 / np.sqrt(1 + size)) / size
    return np.asarray(rows - shrink * np.multiply.outer(wobble, wobble @ rows))

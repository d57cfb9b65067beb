"""Every fit a recording allows, in the paper's order (III): support, moduli, law, contact resistances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ertskin.calibration.result import Calibration
from ertskin.errors import UserError
from ertskin.hardware.recording import Coupon, Recording
from ertskin.physics.calibration.contact_resistance import ContactFit, ContactProblem, direct_search, gauss_newton
from ertskin.physics.calibration.coupon import CouponModulus, coupon_modulus
from ertskin.physics.calibration.indenter_support import IndenterSupport, indenter_support
from ertskin.physics.calibration.moduli import (
    ErrorSurface,
    ModuliFit,
    error_surface,
    fit_moduli,
    moduli_groups,
    with_moduli,
)
from ertskin.physics.calibration.rest_frames import RestScan, rest_scan
from ertskin.physics.calibration.specimen import SpecimenFit, fit_specimen
from ertskin.physics.conduction.sheet import SheetModel
from ertskin.physics.history import Phase
from ertskin.physics.sensor import Sensor

Array = NDArray[np.float64]
Say = Callable[[str], None]

METHODS = ("gauss_newton", "direct_search", "both")
SURFACE_POINTS = 25
SURFACE_SPAN = 4.0
"""The error surface reaches this many times above and below the fitted moduli."""


@dataclass(frozen=True, eq=False)
class Fits:
    """What was fitted, each None where the recording holds nothing to fit it to.

    ``contacts_searched`` is the paper's direct search, where it was asked for beside Gauss-Newton.
    """

    support: IndenterSupport | None = None
    moduli: ModuliFit | None = None
    surface: ErrorSurface | None = None
    specimen: SpecimenFit | None = None
    rest: RestScan | None = None
    contacts: ContactFit | None = None
    contacts_searched: ContactFit | None = None
    coupon: CouponModulus | None = None


def fit_recording(
    recording: Recording,
    name: str,
    method: str = "gauss_newton",
    resolution: str = "fast",
    say: Say = lambda line: None,
) -> tuple[Calibration, Fits]:
    """Fit all that ``recording`` allows; ``say`` gets a line before each step.

    Raises ``UserError`` for an unknown method, where there is nothing to calibrate at all, or where the recording's
    numbers can't be fitted.
    """
    if method not in METHODS:
        raise UserError(f"method={method}: choose one of {', '.join(METHODS)}")
    try:
        return _fit_all(recording, name, method, resolution, say)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise UserError(f"{name}: can't be calibrated on: {error}") from None


def _fit_all(recording: Recording, name: str, method: str, resolution: str, say: Say) -> tuple[Calibration, Fits]:
    fits = Fits()
    if recording.rigid_block is not None:
        say("support of the indenter")
        fits = replace(fits, support=indenter_support(recording.rigid_block.depth_m, recording.rigid_block.force_n))
    sensor = recording.sensor
    if recording.specimen is not None:
        say("piezoresistive law")
        test = recording.specimen
        fits = replace(
            fits,
            specimen=fit_specimen(test.stress_pa, test.sheet_resistance_ohm_sq, test.time_s, test.cycle),
        )
    if sensor is not None:
        fits = _fit_moduli(recording, sensor, fits, say)
        fits = _fit_contacts(recording, sensor, fits, method, resolution, say)
    if recording.coupon is not None:
        say("modulus of the foam coupon")
        fits = replace(fits, coupon=_fit_coupon(recording.coupon, name))
    if all(value is None for value in vars(fits).values()):
        raise UserError(
            f"{name}: nothing to calibrate on: expected rest frames with a sensor, presses with depth and force, "
            "a specimen, a rigid block or a coupon"
        )
    return _assembled(name, sensor, fits), fits


def single_presses(recording: Recording) -> tuple[Array, Array, NDArray[np.int64]]:
    """Depths (N,) in metre, forces (N,) in newton and press numbers (N,) of the frames with one known contact."""
    if recording.frames is None or not recording.frames.history.contact_m.shape[1]:
        return np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64)
    history = recording.frames.history
    depth, force = history.depth_m[:, 0], history.force_n[:, 0]
    used = (history.touched.sum(axis=1) == 1) & history.touched[:, 0] & np.isfinite(depth) & np.isfinite(force)
    return depth[used], force[used], history.press[used]


def _fit_moduli(recording: Recording, sensor: Sensor, fits: Fits, say: Say) -> Fits:
    depth, force, press = single_presses(recording)
    if not sensor.layers or len(depth) < 3:
        return fits
    say("moduli of the layers, with their error surface")
    support = np.inf if fits.support is None else fits.support.stiffness_n_per_m
    groups = moduli_groups(sensor)
    found = fit_moduli(sensor, groups, depth, force, support, press)
    surface = None
    if len(groups) == 2:
        span = np.geomspace(1 / SURFACE_SPAN, SURFACE_SPAN, SURFACE_POINTS)
        axes = (found.moduli_pa[0] * span, found.moduli_pa[1] * span)
        surface = error_surface(sensor, groups, axes, depth, force, support)
    return replace(fits, moduli=found, surface=surface)


def _fit_contacts(recording: Recording, sensor: Sensor, fits: Fits, method: str, resolution: str, say: Say) -> Fits:
    if recording.frames is None or recording.protocol is None or not sensor.electrodes:
        return fits
    rest_v = recording.frames.voltage_v[recording.frames.history.phase == Phase.REST]
    if not len(rest_v):
        return fits
    try:
        rest = rest_scan(rest_v, recording.protocol)
    except ValueError as error:
        raise UserError(f"contact resistances: {error}") from None
    say("contact resistances of the electrodes")
    noise = rest.noise_v / np.sqrt(rest.frames) if np.isfinite(rest.noise_v) else None
    problem = ContactProblem(
        SheetModel(sensor, resolution),
        recording.protocol,
        rest.voltage_v,
        sensor.sheet_resistance_ohm_sq,
        sensor.contact_resistance_guess_ohm,
        fit_sheet=True,
        noise_v=noise,
    )
    try:
        newton = gauss_newton(problem) if method != "direct_search" else None
    except RuntimeError as error:
        raise UserError(
            f"{error}: the resting readings are no even sheet's with contacts; see ertskin doctor"
        ) from None
    if method != "gauss_newton":
        say("contact resistances again, by the paper's direct search")
    searched = direct_search(problem) if method != "gauss_newton" else None
    best = newton or searched
    return replace(fits, rest=rest, contacts=best, contacts_searched=searched if newton else None)


def _fit_coupon(coupon: Coupon, name: str) -> CouponModulus:
    try:
        return coupon_modulus(
            coupon.time_s, coupon.gap_m, coupon.force_n, coupon.height_m, coupon.area_m2, coupon.lateral
        )
    except ValueError as error:
        raise UserError(f"{name}: foam coupon: {error}") from None


def _assembled(name: str, sensor: Sensor | None, fits: Fits) -> Calibration:
    notes: dict[str, float] = {}
    law = None if fits.specimen is None else fits.specimen.law
    if fits.support is not None:
        notes["indenter_error_n_per_m"] = fits.support.standard_error_n_per_m
        notes["force_noise_n"] = fits.support.force_noise_n
    if fits.coupon is not None:
        notes["foam_first_loading_pa"] = fits.coupon.first_pa
    if fits.moduli is not None and sensor is not None:
        sensor = with_moduli(sensor, moduli_groups(sensor), fits.moduli.moduli_pa)
        notes["sensor_stiffness_n_per_m"] = fits.moduli.stiffness_n_per_m
        notes["moduli_relative_error"] = fits.moduli.modulus_relative_error
    if fits.specimen is not None:
        notes["specimen_hysteresis"] = fits.specimen.hysteresis
    if fits.contacts is not None and sensor is not None:
        sensor = replace(sensor, sheet_resistance_ohm_sq=fits.contacts.sheet_resistance_ohm_sq)
        notes["sheet_resistance_error_ohm_sq"] = fits.contacts.sheet_standard_error_ohm_sq
        notes["rest_residual_rms_v"] = fits.contacts.rms_after_v
        law = law if law is None else law.scaled(fits.contacts.sheet_resistance_ohm_sq)
    return Calibration(
        recording=name,
        sensor=sensor,
        law=law,
        contact_resistance_ohm=None if fits.contacts is None else fits.contacts.contact_resistance_ohm,
        contact_resistance_error_ohm=None if fits.contacts is None else fits.contacts.standard_error_ohm,
        indenter_n_per_m=None if fits.support is None else fits.support.stiffness_n_per_m,
        foam_modulus_pa=None if fits.coupon is None else fits.coupon.cycled_pa,
        noise_v=None if fits.rest is None or not np.isfinite(fits.rest.noise_v) else fits.rest.noise_v,
        notes=notes,
    )

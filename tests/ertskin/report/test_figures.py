"""Every figure draws what it is given: its data are on its axes, its units in its labels."""

from __future__ import annotations

import io
import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

from ertskin.physics.sensor import Sensor, rectangle_m, taxel_grid_m
from ertskin.report.figures.contact_resistance_fit import contact_resistance_fit
from ertskin.report.figures.error_surface import error_surface
from ertskin.report.figures.force_depth import force_depth
from ertskin.report.figures.force_scatter import force_scatter
from ertskin.report.figures.hit_rate_by_force import hit_rate_by_force
from ertskin.report.figures.image import data_uri, png
from ertskin.report.figures.method_comparison import method_comparison
from ertskin.report.figures.model_error_by_force import model_error_by_force
from ertskin.report.figures.model_error_cases import model_error_cases
from ertskin.report.figures.recording_timeline import recording_timeline
from ertskin.report.figures.sensor_layout import sensor_layout
from ertskin.report.figures.specimen import specimen
from ertskin.report.figures.taxel_map import taxel_map
from ertskin.report.figures.two_point_panels import two_point_panels

TAXEL_M = taxel_grid_m((0.12, 0.12), 6, 6)
RNG = np.random.default_rng(0)


def example_sensor() -> Sensor:
    """Twenty-four pads in four rings round 36 taxels."""
    angle = np.arange(24) * np.pi / 12
    centre_m = 0.06 + 0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Sensor(
        rectangle_m((0.12, 0.12)),
        electrode_center_m=centre_m,
        electrode_size_m=np.full((24, 2), 0.004),
        taxel_m=TAXEL_M,
    )


def two_point_maps() -> tuple[np.ndarray, np.ndarray]:
    truth, estimate = np.zeros((14, 36)), np.zeros((14, 36))
    for trial in range(14):
        truth[trial, RNG.choice(36, 2, replace=False)] = 4.9
    estimate[truth > 0] = 4.9 + RNG.normal(0, 0.4, 28)
    estimate[3, 0] = 1.2
    return truth, estimate


def drawn() -> dict[str, Figure]:
    """One example of every figure."""
    depth_m = np.linspace(0, 4e-3, 40)
    force_n = 2000 * depth_m + 4e5 * depth_m**2
    stress_pa = RNG.uniform(0, 1e5, 300)
    law = (18e3 * np.exp(-stress_pa / 2e4) + 2e3) * (1 + 0.02 * RNG.standard_normal(300))
    grid = np.linspace(0, 1e5, 100)
    soft_pa, stiff_pa = np.geomspace(1e4, 1e5, 30), np.geomspace(1e5, 1e6, 30)
    error_m = 1e-5 + 4e-4 * (np.log(soft_pa / 2.8e4)[:, None] ** 2 + 0.05 * np.log(stiff_pa / 3.4e5) ** 2)
    readings_v = np.abs(RNG.normal(1.0, 0.4, 6624))
    true_n = RNG.uniform(0.5, 9, 288)
    rmse_v = 2e-3 + 1e-3 * true_n + 5e-4 * RNG.random(288)
    truth, estimate = two_point_maps()
    names = ["six networks", "paper's pipeline", "oracle", "kernel ridge", "ridge", "mean"]
    return {
        "force_depth": force_depth(
            depth_m, force_n, depth_m, 1.02 * force_n, rigid_depth_m=depth_m, rigid_force_n=8e3 * depth_m
        ),
        "specimen": specimen(stress_pa, law, grid, 18e3 * np.exp(-grid / 2e4) + 2e3),
        "error_surface": error_surface(soft_pa, stiff_pa, error_m, (2.8e4, 3.4e5)),
        "contact_resistance_fit": contact_resistance_fit(
            readings_v, readings_v * 0.9, readings_v + 2e-3 * RNG.standard_normal(6624)
        ),
        "model_error_by_force": model_error_by_force(true_n, rmse_v, 2e-3),
        "model_error_cases": model_error_cases(
            RNG.normal(0, 0.1, (2, 6624)), RNG.normal(0, 0.1, (2, 6624)), ("taxel 5, 8.1 N", "taxel 20, 0.9 N")
        ),
        "hit_rate_map": taxel_map(
            TAXEL_M, RNG.uniform(60, 100, 36), "hit rate / %", (0, 100), "Blues", "{:.0f}", "one-point hit rate"
        ),
        "force_scatter": force_scatter(
            true_n, np.where(true_n < 0.8, 0, true_n + RNG.normal(0, 0.3, 288)), true_n < 0.8, "network"
        ),
        "two_point_panels": two_point_panels(TAXEL_M, truth, estimate),
        "hit_rate_by_force": hit_rate_by_force(
            true_n, {"network": true_n + RNG.normal(0, 1, 288) > 1, "ridge": true_n + RNG.normal(0, 1, 288) > 3}
        ),
        "method_comparison": method_comparison(
            names,
            [RNG.normal(100 - 8 * k, 1.0, 3) for k in range(6)],
            "one-point hit rate / %",
            [True, True, False, False, False, False],
            82.0,
        ),
        "sensor_layout": sensor_layout(example_sensor()),
        "recording_timeline": recording_timeline(
            np.arange(300) * 0.5, np.abs(np.sin(np.arange(300) / 10)) * 8, np.abs(np.sin(np.arange(300) / 10)) / 20,
            (np.arange(300) % 31 > 3).astype(np.uint8), "one-point recording",
        ),
    }  # fmt: skip


@pytest.fixture(scope="module")
def figures() -> dict[str, Figure]:
    return drawn()


def test_every_figure_has_words_and_units_on_its_axes(figures):
    for name, figure in figures.items():
        labels = " ".join(axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes)
        assert "/" in labels, f"{name} shows no unit: {labels!r}"


def test_every_figure_becomes_a_picture_that_is_not_blank(figures):
    for name, figure in figures.items():
        pixels = imread(io.BytesIO(png(figure)))
        assert pixels.std() > 0.02, f"{name} is blank"


def test_the_same_drawing_gives_the_same_bytes():
    first, second = (png(taxel_map(TAXEL_M, np.arange(36.0), "force / N")) for _ in range(2))
    assert first == second
    assert data_uri(first).startswith("data:image/png;base64,iVBOR")


def test_force_scatter_states_its_own_error(figures):
    truth, estimate = np.array([1.0, 2.0, 4.0]), np.array([1.0, 2.0, 1.0])
    words = [text.get_text() for text in force_scatter(truth, estimate, truth > 9).axes[0].texts]
    assert words == [f"RMSE {np.sqrt(3):.2g} N, r {np.corrcoef(truth, estimate)[0, 1]:.3f}"]


def test_two_point_panels_mark_the_ghost(figures):
    titles = [text.get_text() for text in figures["two_point_panels"].axes[0].texts]
    assert titles.count("✓ exact") == 13
    assert titles.count("✗ estimate") == 1


def test_taxel_map_letters_each_known_taxel():
    values = np.arange(36.0)
    values[4] = np.nan
    figure = taxel_map(TAXEL_M, values, "force / N", form="{:.0f}")
    assert {text.get_text() for text in figure.axes[0].texts} == {str(k) for k in range(36) if k != 4}


def test_long_names_leave_the_panel_its_room():
    names = [f"{kind} (with sheet_inhomogeneity, piezo_hysteresis, scan_skew)" for kind in ("contacts", "reciprocal")]
    compared = method_comparison(names, [np.ones(1), np.ones(1)], "force error / N", [True, True])
    by_force = hit_rate_by_force(np.linspace(0, 5, 40), {name: np.ones(40, bool) for name in names})
    for figure in (compared, by_force):
        png(figure)
        assert figure.axes[0].get_position().width > 0.5


def test_long_names_do_not_overlap():
    names = [
        "ridge",
        *(f"paper (data.plan.denoiser_trials {k}, data.plan.shard 600, data.plan.steps 100)" for k in "12"),
    ]
    figure = method_comparison(names, [np.ones(1)] * 3, "hit rate / %", [False, True, True], paper=0.8)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    boxes = [label.get_window_extent(canvas.get_renderer()) for label in figure.axes[0].get_yticklabels()]
    boxes.sort(key=lambda box: box.y0)
    assert all(below.y1 <= above.y0 for below, above in itertools.pairwise(boxes))

"""The results as tables of a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import trials

Row = dict[str, Any]


def page(results: Row) -> Iterator[str]:
    """Lines of the tables of all sections there are."""
    sections: dict[str, Callable[[Any], Iterator[str]]] = {
        "machine": host_lines,
        "frame": frame_table,
        "jacobian": jacobian_table,
        "electrodes": electrode_table,
        "contacts": press_table,
        "trials": trial_table,
        "neighbours": neighbour_lines,
        "contact_fit": contact_table,
        "loops": loop_table,
        "training": training_table,
        "cluster": cluster_table,
    }
    for name, lines in sections.items():
        if name in results:
            yield from lines(results[name])


def host_lines(host: Row) -> Iterator[str]:
    """What it was measured on."""
    packages = ", ".join(f"{name} {number}" for name, number in host["packages"].items())
    yield f"{host['processor']}, {host['cores']} cores, load {host['load']:.1f} at the start; "
    yield f"Python {host['python']}, {packages}; commit {host['commit']}."
    yield "One thread, CPU milliseconds, medians; in brackets the median of the ratio to ertskin within a turn."


def frame_table(rows: list[Row]) -> Iterator[str]:
    """One frame against nodes."""
    yield from table(
        ["one frame, 24 electrodes, 6,624 readings", "ertskin", "SciPy, factor once", "pyEIT"],
        [
            [f"{row['nodes']:,} nodes", *times(row), with_ratio(row["pyEIT"]) if "pyEIT" in row else "not run"]
            for row in rows
        ],
    )


def jacobian_table(rows: list[Row]) -> Iterator[str]:
    """Derivatives."""
    yield from table(
        ["Jacobian of 276 numbers by every element", "ertskin", "NumPy after factor once"],
        [[f"{row['nodes']:,} nodes", *times(row)] for row in rows],
    )


def electrode_table(rows: list[Row]) -> Iterator[str]:
    """One frame against electrodes."""
    yield from table(
        ["one frame, about 10,000 nodes, all pairs driven", "ertskin", "SciPy, factor once"],
        [[f"{row['electrodes']} electrodes", *times(row)] for row in rows],
    )


def press_table(rows: list[Row]) -> Iterator[str]:
    """Presses solved one by one."""
    yield from table(
        ["contacts anywhere on the padded sheet, CPU ms a trial", "`fast` mesh", "`fine` mesh"],
        [[str(row["contacts"]), f"{row['fast']:.1f}", f"{row['fine']:.1f}"] for row in rows],
    )


def trial_table(meshes: list[Row]) -> Iterator[str]:
    """The paper's trials on both meshes."""
    cells: dict[str, Callable[[Row], str]] = {
        "unknowns of the sheet": lambda row: f"{row['nodes']:,}",
        f"on {meshes[0]['workers']} thread(s): wall s": lambda row: f"{row['seconds']:.1f}",
        "CPU s": lambda row: f"{row['cpu_s']:.0f}",
        "on one thread: CPU ms a trial": lambda row: f"{row['one_thread_cpu_ms_per_trial']:.2f}",
        "preparation: wall, CPU s": lambda row: f"{row['preparation_s']:.0f}, {row['preparation_cpu_s']:.0f}",
        "SciPy, factor once on the same mesh: CPU ms a trial": lambda row: (
            f"{1e3 * row['factor_once_cpu_s_per_trial']:,.0f}"
        ),
        "ratio of CPU times": lambda row: f"{row['ratio_cpu']:,.0f}",
        "peak memory so far, GB": lambda row: f"{row['peak_memory_gb']:.1f}",
        "error against the reference mesh, in the readings": lambda row: f"{row['reference_error']['readings']:.3f}",
        "the same in the 276 numbers": lambda row: f"{row['reference_error']['reciprocal']:.3f}",
        "error against the same mesh solved directly, in the 276 numbers": lambda row: (
            f"{row['same_mesh_error']['reciprocal']:.3f}"
        ),
        "the same in the worst trial": lambda row: f"{row['same_mesh_error']['worst_reciprocal']:.3f}",
    }
    header = [f"the paper's {meshes[0]['trials']:,} trials", *(f"`{row['resolution']}`" for row in meshes)]
    yield from table(header, [[name, *map(cell, meshes)] for name, cell in cells.items()])
    yield f"Rms errors in units of a 2 mV noise, over {trials.CHECKED} trials, neighbours among them; load"
    yield f"{meshes[-1]['load']:.1f} at the end."


def neighbour_lines(row: Row) -> Iterator[str]:
    """The hardest presses."""
    yield f"All {row['pairs']} pairs of taxels less than {1e3 * row['apart_m']:.0f} mm apart, {row['force_n']:.0f} N on"
    yield f"each, in the 276 numbers: {row['rms']:.3f} of the noise rms against the `fine` mesh solved in full,"
    yield f"{row['worst']:.3f} in the worst."


def contact_table(row: Row) -> Iterator[str]:
    """Gauss-Newton and direct search."""
    yield from table(
        ["24 contact resistances from an unloaded scan", "wall s", "solutions"],
        [
            ["Gauss-Newton", f"{row['gauss_newton_s']:.3f}", str(row["gauss_newton_solutions"])],
            ["direct search, on a reduction", f"{row['direct_search_s']:.1f}", f"{row['direct_search_solutions']:,}"],
        ],
    )
    yield f"{row['unknowns']:,} unknowns, load {row['load']:.1f}. Ratio of CPU times: {row['ratio_cpu']:.0f} to the"
    yield f"search on a reduction, {row['ratio_without_reduction']:.0f} to one that solves the mesh each time (reckoned"
    yield f"from one solution). The optima differ by {row['gap_standard_errors']:.3f} of a standard error at most."


def loop_table(row: Row) -> Iterator[str]:
    """Steps a second."""
    loops = [(name, value) for name, value in row.items() if isinstance(value, dict)]
    yield from table(
        ["masked network, batch 32, one thread", "steps a second", "ertskin over it"],
        [[name, f"{value['steps_per_s']:,.0f}", f"{value['ratio']:.2f}"] for name, value in loops],
    )


def training_table(row: Row) -> Iterator[str]:
    """The whole training."""
    yield from table(
        [f"denoiser and masked network, {row['trials']:,} trials, {row['threads']} thread(s)", "epochs", "wall s"],
        [
            [name, f"{row[epochs]['denoiser']}, {row[epochs]['network']}", f"{row[seconds]:.0f}"]
            for name, epochs, seconds in (
                ("to the last epoch", "epochs", "seconds"),
                ("to convergence (10 epochs without a lower loss)", "epochs_with_patience", "seconds_with_patience"),
            )
        ],
    )
    yield f"Load {row['load']:.1f} at the end."


def cluster_table(row: Row) -> Iterator[str]:
    """Synthesis over processes and Dask."""
    yield from table(
        [f"synthesis of {row['trials']:,} trials, `fast` mesh", "wall s", "times one process"],
        [
            [name, f"{each['seconds']:.1f}", f"{each['times_one_process']:.2f}"]
            for name, each in row["clusters"].items()
        ],
    )
    yield f"Medians of {row['turns']} turns, load {row['load']:.1f} at the end; every shard the same byte for byte."


def table(header: list[str], rows: list[list[str]]) -> Iterator[str]:
    """A table's lines with a blank one before and after."""
    yield ""
    for cells in (header, ["---"] * len(header), *rows):
        yield f"| {' | '.join(cells)} |"
    yield ""


def times(row: Row) -> list[str]:
    """Our milliseconds, and the plain solver's with its ratio."""
    return [f"{row['ertskin']['ms']:.2f}", with_ratio(row["SciPy, factor once"])]


def with_ratio(entry: Row) -> str:
    """Milliseconds and ratio."""
    return f"{entry['ms']:,.1f} ({entry['ratio']:,.1f})"

"""Run every benchmark and write results.json, the tables in README.md and scaling.png.

python experiments/benchmarks/run.py [--small]
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse  # noqa: E402
import json  # noqa: E402
import platform  # noqa: E402
import subprocess  # noqa: E402
from collections.abc import Iterator  # noqa: E402
from importlib.metadata import version  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import cluster  # noqa: E402
import contact_fit  # noqa: E402
import single_frame  # noqa: E402
import tables  # noqa: E402
import training  # noqa: E402
import trials  # noqa: E402

from ertskin.data.synthesis import Plan  # noqa: E402

FOLDER = Path(__file__).resolve().parent
PACKAGES = ("numpy", "scipy", "numba", "pyeit", "torch", "lightning", "distributed")
BEGIN, END = "<!-- results -->", "<!-- end of results -->"


def measure(small: bool, only: list[str] | None) -> Iterator[tuple[str, Any]]:
    """Each section with its result, or some of them; ``small``: two meshes, few turns and trials, for a look."""
    turns = 5 if small else 15
    pairs = 400 if small else 32_400
    sizes = (2_500, 10_000) if small else (2_500, 10_000, 40_000)
    cores = len(os.sched_getaffinity(0))
    sections = {
        "machine": machine,
        "frame": lambda: [shown(single_frame.frame(n, turns, with_pyeit=n <= 10_000)) for n in sizes],
        "jacobian": lambda: [shown(single_frame.jacobian(n, max(3, turns // 3))) for n in sizes[:2]],
        "electrodes": lambda: [
            shown(single_frame.electrodes(n, turns)) for n in ((16, 32) if small else (16, 24, 32, 64))
        ],
        "contacts": lambda: [shown(trials.contacts(n, 30 if small else 200)) for n in (1, 2, 3, 4)],
        "trials": lambda: [shown(trials.run(pairs, cores, mesh)) for mesh in ("fast", "fine")],
        "neighbours": lambda: shown(trials.neighbours(cores)),
        "contact_fit": lambda: shown(contact_fit.run("fast", turns)),
        "loops": lambda: shown(training.loops(training.material(pairs, cores), 1 if small else 3, 3 if small else 5)),
        "training": lambda: shown(training.full(training.material(pairs, cores), cores)),
        "cluster": lambda: shown(cluster.run(Plan(trials=pairs, denoiser_trials=0), turns=1 if small else 2)),
    }
    for name, section in sections.items():
        if only is None or name in only:
            yield name, section()


def machine() -> dict:
    """What it ran on."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES},
        "commit": commit(),
        "load": os.getloadavg()[0],
    }


def commit() -> str:
    """The checkout's commit."""
    asked = ["git", "-C", str(FOLDER), "rev-parse", "--short", "HEAD"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"


def shown(result: dict) -> dict:
    """The result, shown as soon as it is there."""
    print(json.dumps(result), flush=True)
    return result


def processor() -> str:
    """The processor's name."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def draw(results: dict, path: Path) -> None:
    """Time of a frame against nodes, and against electrodes."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), constrained_layout=True)
    for name in ("ertskin", "SciPy, factor once", "pyEIT"):
        rows = [row for row in results["frame"] if name in row]
        left.loglog([row["nodes"] for row in rows], [row[name]["ms"] for row in rows], "o-", label=name)
    left.set(xlabel="nodes", ylabel="ms a frame, one thread", title="24 electrodes, 6,624 readings")
    left.legend(loc="upper right", fontsize="small")
    for name in ("ertskin", "SciPy, factor once"):
        right.loglog(
            [row["electrodes"] for row in results["electrodes"]],
            [row[name]["ms"] for row in results["electrodes"]],
            "o-",
            label=name,
        )
    right.set(xlabel="electrodes", ylabel="ms a frame, one thread", title="about 10,000 nodes")
    for axes, ticks in (
        (left, [row["nodes"] for row in results["frame"]]),
        (right, [row["electrodes"] for row in results["electrodes"]]),
    ):
        axes.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
        axes.set_xticks([], minor=True)
        axes.grid(True, which="both", alpha=0.3)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure, then write table, plot and numbers; ``--small`` prints only."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="a look in a few minutes; writes nothing")
    parser.add_argument("--only", metavar="SECTION", nargs="+", help="measure these again and keep the others")
    arguments = parser.parse_args()
    store = FOLDER / "results.json"
    results = json.loads(store.read_text()) if arguments.only and not arguments.small else {}
    for name, result in measure(arguments.small, arguments.only):
        results[name] = result
        if not arguments.small:
            replace(store, json.dumps(results, indent=1) + "\n")
    lines = "\n".join(tables.page(results))
    print(lines)
    if arguments.small:
        return
    draw(results, FOLDER / "scaling.png")
    readme = FOLDER / "README.md"
    before, rest = readme.read_text().split(BEGIN)
    replace(readme, before + BEGIN + "\n" + lines + "\n" + END + rest.split(END)[1])


def replace(path: Path, text: str) -> None:
    """Write aside and rename."""
    aside = path.with_name(path.name + ".part")
    aside.write_text(text)
    os.replace(aside, path)


if __name__ == "__main__":
    main()

"""Foam coupons: fit the fast cycles, predict the slow ramp and hold; let four specimens predict the fifth.

    python experiments/real/foam/run.py DATA [OUT]

DATA holds real/foam_turbo_free_1.h5 to _5.h5; results and figures go to OUT, this folder by default.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from figures import dwell_figure, parameter_figure, slow_figure
from forms import FORMS, OURS, ConstrainedFit, elastic_fit
from numpy.typing import NDArray
from specimen import Fit, Specimen

from ertskin.diagnosis.coupon.diagnosis import FORM, HELD
from ertskin.diagnosis.coupon.fit import fit_coupon
from ertskin.files import write_whole
from ertskin.report.figures.image import save_png

Array = NDArray[np.float64]
NUMBERS = (1, 2, 3, 4, 5)
ELASTIC, CONSTRAINED, CHOSEN = "elastic", "plain constrained fit", "form the four chose"
BASELINES: dict[str, Fit] = {
    ELASTIC: elastic_fit,
    CONSTRAINED: ConstrainedFit(),
    f"{CONSTRAINED}, gap mended": ConstrainedFit(mended=True),
}


def main() -> None:
    """Every form on every coupon, the forms chosen without its slow part, four specimens for the fifth."""
    data = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
    specimens = [Specimen.read(data, number) for number in NUMBERS]
    predictions, forms = compared(specimens)
    results = {
        "forms": forms,
        "chosen": {
            "by the slow parts of the other four": chosen(forms, by_others),
            "by its own later cycles": chosen(forms, by_later_cycles),
        },
    }
    results["four for the fifth"] = left_out(
        specimens, results["chosen"]["by the slow parts of the other four"]["form"]
    )
    write_whole(out / "results.json", json.dumps(results, indent=1) + "\n")
    drawn = {ELASTIC: "tab:gray", CONSTRAINED: "tab:orange", OURS: "tab:red"}
    save_png(slow_figure([s.test for s in specimens], predictions, drawn), out / "slow.png")
    save_png(dwell_figure(specimens[0].coupon, specimens[0].test), out / "dwell.png")
    models = [fit_coupon([s.test], [s.fast], FORM, HELD) for s in specimens]
    save_png(parameter_figure(models), out / "parameters.png")
    print(table(results))


def compared(specimens: list[Specimen]) -> tuple[list[dict[str, Array]], dict[str, Any]]:
    """Every form's prediction of every coupon, and its errors in newton: on the fast cycles it is fitted to, on later
    cycles from the earlier ones alone, on the slow part."""
    predictions: list[dict[str, Array]] = [{} for _ in specimens]
    results: dict[str, Any] = {}
    for name, fit in (BASELINES | FORMS).items():
        row: dict[str, list[float]] = {"fast_n": [], "later_cycles_n": [], "slow_n": []}
        for k, one in enumerate(specimens):
            force, later = fit([one], [one.fast])(one), fit([one], [one.early])(one)
            predictions[k][name] = force
            row["fast_n"].append(one.rmse_n(force, one.fast))
            row["later_cycles_n"].append(one.rmse_n(later, one.fast & ~one.early))
            row["slow_n"].append(one.rmse_n(force, one.slow))
        results[name] = row
        print(line(name, row["slow_n"]), flush=True)
    return predictions, results


def by_others(row: dict[str, list[float]], k: int) -> float:
    """Median error on the slow parts of the coupons other than ``k``."""
    return float(np.median(np.delete(row["slow_n"], k)))


def by_later_cycles(row: dict[str, list[float]], k: int) -> float:
    """Error on the later fast cycles of coupon ``k`` itself, predicted from its earlier ones."""
    return row["later_cycles_n"][k]


def chosen(forms: dict[str, Any], judge: Any) -> dict[str, Any]:
    """For each coupon the form that ``judge`` finds best, and that form's error on the coupon's slow part."""
    names = [min(FORMS, key=lambda name: judge(forms[name], k)) for k in range(len(NUMBERS))]
    return {"form": names, "slow_n": [forms[name]["slow_n"][k] for k, name in enumerate(names)]}


def left_out(specimens: list[Specimen], names: list[str]) -> dict[str, Any]:
    """What four specimens' whole tests say about the fifth; ``names``: the form each four chose.

    Either everything is taken from the four, or their memory alone, and the elastic curve from the fifth's fast cycles.
    """
    results: dict[str, Any] = {}
    for k, fifth in enumerate(specimens):
        others = specimens[:k] + specimens[k + 1 :]
        rows = [s.fast | s.slow for s in others]
        form = FORMS[names[k]]
        shared = {
            ELASTIC: elastic_fit(others, rows),
            CONSTRAINED: ConstrainedFit()(others, rows),
            CHOSEN: form(others, rows),
        }
        forces = {f"{name}, all from the four": predict(fifth) for name, predict in shared.items()}
        forces[f"{ELASTIC}, its own curve"] = elastic_fit([fifth], [fifth.fast])(fifth)
        forces[f"{CHOSEN}, its own curve"] = form.remembering(others, rows)([fifth], [fifth.fast])(fifth)
        for name, force in forces.items():
            row = results.setdefault(name, {"slow_n": [], "fast_n": []})
            row["slow_n"].append(fifth.rmse_n(force, fifth.slow))
            row["fast_n"].append(fifth.rmse_n(force, fifth.fast))
        print(f"coupon {NUMBERS[k]} from the others: " + ", ".join(f"{r['slow_n'][-1]:.3f}" for r in results.values()))
    return results


def table(results: dict[str, Any]) -> str:
    """Errors on the slow part as Markdown tables."""
    head = "| {} | " + " | ".join(map(str, NUMBERS)) + " | median | {} |\n" + "| --- " * (len(NUMBERS) + 3) + "|"
    lines = [head.format("fitted on the fast cycles", "later cycles")]
    lines += [line(name, row["slow_n"], row["later_cycles_n"]) for name, row in results["forms"].items()]
    lines += [line(f"*chosen {name}*", row["slow_n"]) for name, row in results["chosen"].items()]
    lines += ["", head.format("fitted on the other four", "fast cycles")]
    lines += [line(name, row["slow_n"], row["fast_n"]) for name, row in results["four for the fifth"].items()]
    return "\n".join(lines)


def line(name: str, slow_n: list[float], last_n: list[float] | None = None) -> str:
    """A row of a table."""
    last = "" if last_n is None else f"{np.median(last_n):.3f}"
    return f"| {name} | " + " | ".join(f"{e:.3f}" for e in slow_n) + f" | {np.median(slow_n):.3f} | {last} |"


if __name__ == "__main__":
    main()

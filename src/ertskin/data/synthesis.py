"""Simulated trials: planned, computed shard by shard wherever there is a worker, and kept (paper IV-B)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from typing import Protocol as Interface

import numpy as np
from numpy.typing import NDArray

from ertskin.data.anywhere_plan import AnywherePlan, Stated
from ertskin.data.shards import Arrays, ShardStore, fill
from ertskin.data.trials import TrialSet
from ertskin.physics.trials import Trials, many_point, one_point
from ertskin.settings import checked, limited

Array = NDArray[np.float64]
# Streams of random trials that must never share a draw.
NETWORK_SEED, DENOISER_SEED = 0, 1


class Forward(Interface):
    """A simulated skin, as far as synthesis needs it."""

    def change_ohm(self, contact_m: Array, force_n: Array) -> Array:
        """(N,P) change of the pair resistances under contacts (N,C,2) with forces (N,C)."""
        ...


@dataclass(frozen=True)
class Plan:
    """How many trials of which kind. ``steps`` of force up to ``max_force_n`` on every taxel; ``trials`` presses of
    ``contacts`` taxels at once; ``denoiser_trials`` more of those for the denoiser.

    ``min_force_n``: least force of a random press. ``jitter_m``: standard deviation of where a contact lands about its
    taxel, 0 as in the paper. ``shard``: trials computed at a time.
    """

    steps: int = limited(100, least=1)
    max_force_n: float = limited(10.0, above=0)
    min_force_n: float = limited(0.1, least=0)
    trials: int = limited(32_400, least=0)
    contacts: int = limited(2, least=1)
    denoiser_trials: int = limited(1800, least=0)
    jitter_m: float = limited(0.0, least=0)
    seed: int = limited(0, least=0)
    shard: int = limited(600, least=1)

    def presses(self, taxel_m: Array) -> tuple[Trials, Trials]:
        """The presses for the network (one-point, then many-point) and those for the denoiser."""
        single = one_point(taxel_m, self.steps, self.max_force_n)
        return (
            _joined(single, self._random(taxel_m, self.trials, NETWORK_SEED), self.contacts),
            self._random(taxel_m, self.denoiser_trials, DENOISER_SEED),
        )

    def _random(self, taxel_m: Array, trials: int, stream: int) -> Trials:
        return many_point(
            taxel_m,
            trials,
            contacts=self.contacts,
            min_force_n=self.min_force_n,
            max_force_n=self.max_force_n,
            jitter_m=self.jitter_m,
            seed=2 * self.seed + stream,
        )


def planned(section: Any) -> Plan:
    """The configuration's ``data.plan``; ``UserError`` for a wrong value."""
    return checked(Plan, section, "data.plan")


def check_plan(data: Any) -> None:
    """``UserError`` for a wrong value in the ``plan`` of the configuration's ``data``, whichever kind it is of, or
    in its ``stated``."""
    if "plan" in data:
        checked(AnywherePlan if "table" in data else Plan, data.plan, "data.plan")
    if "stated" in data:
        checked(Stated, data.stated, "data.stated")


@dataclass(frozen=True, eq=False)
class Shard:
    """Computes shard k of the presses: plain arrays out, so that any process may do it.

    A ``forward`` that has a method ``prepare()`` is built once and travels so.
    """

    forward: Forward
    presses: Trials
    rows: int

    def prepare(self) -> None:
        """Build the simulated skin."""
        getattr(self.forward, "prepare", lambda: None)()

    def __call__(self, number: int) -> Arrays:
        part = self.presses[slice(number * self.rows, (number + 1) * self.rows)]
        return {"change_ohm": self.forward.change_ohm(part.contact_m, part.force_n)}


def synthesize(
    folder: Path,
    request: dict[str, Any],
    plan: Plan,
    taxel_m: Array,
    forward: Callable[[], Forward],
    cluster: Any,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[TrialSet, TrialSet, str]:
    """Trials for the network, trials for the denoiser, and the data's checksum; what is there already is only read.

    ``request``: plain data that names the skin; the plan and the taxels are added to it. ``forward`` is built only if
    something is missing. ``cluster`` is one of ``ertskin.cluster``. ``progress(done, total)`` counts shards. Killed
    and started again it goes on; the result doesn't depend on the workers.
    """
    network, denoiser = plan.presses(taxel_m)
    presses = _joined(network, denoiser, plan.contacts)
    total = -(-len(presses) // plan.shard)
    store = ShardStore(folder, {**request, "plan": asdict(plan), "taxel_m": taxel_m.tolist()}, total)
    missing = store.missing()
    if missing:
        done = iter(range(total - len(missing) + 1, total + 1))
        progress(total - len(missing), total)
        fill(store, Shard(forward(), presses, plan.shard), cluster.spread, lambda number: progress(next(done), total))
    elif not store.sealed:
        store.seal()
    change = store.read()["change_ohm"]
    sets = [
        TrialSet(change[part], trials.force_map_n(len(taxel_m)), trials.contact_m, trials.force_n)
        for trials, part in ((network, slice(0, len(network))), (denoiser, slice(len(network), None)))
    ]
    return sets[0], sets[1], store.checksum


def _joined(first: Trials, second: Trials, contacts: int) -> Trials:
    """Both, with room for ``contacts`` each: absent contacts have NaN for place and force."""
    parts = [_padded(first, contacts), _padded(second, contacts)]
    return Trials(
        np.concatenate([p.taxel for p in parts]),
        np.concatenate([p.contact_m for p in parts]),
        np.concatenate([p.force_n for p in parts]),
    )


def _padded(trials: Trials, contacts: int) -> Trials:
    absent = contacts - trials.taxel.shape[1]
    return Trials(
        np.pad(trials.taxel, ((0, 0), (0, absent))),
        np.pad(trials.contact_m, ((0, 0), (0, absent), (0, 0)), constant_values=np.nan),
        np.pad(trials.force_n, ((0, 0), (0, absent)), constant_values=np.nan),
    )

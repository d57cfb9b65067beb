"""Trials anywhere are the same whichever are wanted; splines that are kept are the ones that were made."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from ertskin.data.anywhere import AnywhereSkin, drawn, touch_model
from ertskin.data.anywhere_plan import AnywherePlan
from ertskin.data.touch_table import SPLINES, keep_splines, kept_splines
from ertskin.physics.noise import WhiteNoise
from ertskin.physics.protocol import Protocol, electrode_pairs

sys.path.insert(0, str(Path(__file__).parents[2] / "physics" / "touch"))
from toy_skin import EXTENT_M, toy_table

PROTOCOL = Protocol.against_sink(electrode_pairs(10), 10, 1e-3)
PAD = np.eye(42, 45)


def toy_skin() -> AnywhereSkin:
    plan = AnywherePlan(trials=60, contacts=3)
    table = replace(toy_table().seen(PAD), read=np.eye(45))
    noise = WhiteNoise(PROTOCOL, 1.0)
    whole = touch_model(PROTOCOL, table, noise, None, correct=False)
    taxel_m = np.stack(np.meshgrid(*EXTENT_M.T), axis=-1).reshape(-1, 2)
    return AnywhereSkin(PROTOCOL, noise, whole, whole.strongest(24), taxel_m, *drawn(table, plan), plan.seed, "toy")


def test_a_trial_is_the_same_whichever_others_are_wanted() -> None:
    skin = toy_skin()
    every, some = skin.trials(np.arange(60)), skin.trials(wanted := np.array([41, 3, 59, 0]))
    scale = np.abs(every.change_ohm).max()
    np.testing.assert_allclose(some.change_ohm, every.change_ohm[wanted], atol=1e-12 * scale)
    np.testing.assert_array_equal(some.force_map_n, every.force_map_n[wanted])
    np.testing.assert_array_equal(some.contacts, 1 + wanted % 3)
    errors = every.change_ohm - PROTOCOL.unwhitened(
        np.linalg.solve(skin.whole.matrix.T, skin.whole.table.change(skin.contact_m, skin.force_n).T).T
    )
    assert (np.abs(errors).max(axis=1) > 1e-6 * scale).all()  # What a response may err by is drawn for every trial.


def test_kept_splines_are_the_ones_that_were_made(tmp_path: Path) -> None:
    made, path = toy_table(), tmp_path / "splines.npz"
    assert kept_splines(path, made.grid, made.interplay) is None
    keep_splines(path, made)
    kept = kept_splines(path, made.grid, made.interplay)
    assert kept is not None
    for name in (*SPLINES, "read"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(made, name))
        assert getattr(kept, name).dtype == getattr(made, name).dtype


def test_damaged_splines_are_made_again(tmp_path: Path) -> None:
    made, path = toy_table(), tmp_path / "splines.npz"
    keep_splines(path, made)
    whole = path.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], whole[:5000] + bytes(500) + whole[5500:]):
        path.write_bytes(damaged)
        assert kept_splines(path, made.grid, made.interplay) is None

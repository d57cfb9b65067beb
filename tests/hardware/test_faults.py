"""Faults thrown at the instruments: every promise kept. The ten thousand are in ``experiments/bench``."""

from __future__ import annotations

import zlib

import pytest

from ertskin.hardware.virtual.fault_trial import (
    LOAD_CELLS,
    READERS,
    STAGES,
    Tally,
    try_experiment,
    try_load_cell,
    try_reader,
    try_stage,
)


def assert_kept(tally: Tally) -> None:
    """No promise broken."""
    assert tally.broken == 0, tally


@pytest.mark.parametrize("kind", READERS)
def test_readers(kind: str) -> None:
    tally = try_reader(kind, 60, seed=11)
    assert_kept(tally)
    assert tally.handed_out > 20
    assert tally.reported > 0


@pytest.mark.parametrize("kind", LOAD_CELLS)
def test_load_cells(kind: str) -> None:
    tally = try_load_cell(kind, 60, seed=12)
    assert_kept(tally)
    assert tally.handed_out > 20


@pytest.mark.parametrize("kind", STAGES)
def test_stages(kind: str) -> None:
    tally = try_stage(kind, 40, seed=13)
    assert_kept(tally)
    assert tally.handed_out > 5


@pytest.mark.parametrize(
    ("stage", "load_cell", "reader"),
    [("grbl", "hx711", "link"), ("marlin", "mark10", "link"), ("grbl", "futek", "eit_kit")],
)
def test_experiments(stage: str, load_cell: str, reader: str) -> None:
    tally = try_experiment(stage, load_cell, reader, seed=14, share=0.02)
    assert_kept(tally)
    assert tally.faults > 5


def test_the_trial_sees_a_reader_that_does_not_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without checksums damaged scans get through, and the trial says so."""
    monkeypatch.setattr(zlib, "crc32", lambda _data: 0)
    assert try_reader("link", 150, seed=11).wrong > 0

"""Shards survive kills and damage, and refuse to be mixed."""

import numpy as np
import pytest

from ertskin.data.shards import ShardStore, fill
from ertskin.errors import UserError

REQUEST = {"seed": 1, "grid": [3, 3]}


def piece(number):
    return {"value": np.random.default_rng((1, number)).standard_normal(5)}


def inline(compute, numbers):
    for number in numbers:
        yield number, compute(number)


def test_a_set_cut_short_goes_on_and_is_bit_identical(tmp_path):
    whole = ShardStore(tmp_path / "whole", REQUEST, 4)
    checksum = fill(whole, piece, inline, lambda number: None)
    cut = ShardStore(tmp_path / "cut", REQUEST, 4)
    cut.write(2, piece(2))
    (tmp_path / "cut" / "shard-00003.1.tmp").write_bytes(b"half a shard")
    with pytest.raises(UserError, match="not complete"):
        _ = cut.checksum
    computed = []
    assert fill(ShardStore(tmp_path / "cut", REQUEST, 4), piece, inline, computed.append) == checksum
    assert computed == [0, 1, 3]
    assert np.array_equal(cut.read()["value"], whole.read()["value"])
    assert not list((tmp_path / "cut").glob("*.tmp"))


def test_a_damaged_shard_is_computed_again(tmp_path):
    store = ShardStore(tmp_path, REQUEST, 3)
    checksum = fill(store, piece, inline, lambda number: None)
    path = tmp_path / "shard-00001.npz"
    path.write_bytes(path.read_bytes()[:-20] + bytes(20))
    assert store.missing() == [1]
    assert fill(store, piece, inline, lambda number: None) == checksum


def test_another_request_is_refused(tmp_path):
    ShardStore(tmp_path, REQUEST, 3)
    with pytest.raises(UserError, match="another request"):
        ShardStore(tmp_path, {**REQUEST, "seed": 2}, 3)

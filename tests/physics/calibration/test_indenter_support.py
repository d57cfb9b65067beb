"""k_ind from the rigid block."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ertskin.physics.calibration.indenter_support import indenter_support


def test_recovers_stiffness_through_noise_offset_and_an_outlier():
    rng = np.random.default_rng(0)
    depth = np.linspace(0, 1e-3, 21)
    force = 9000 * depth + 0.02 + 0.01 * rng.standard_normal(21)
    force[11] += 3.0
    support = indenter_support(depth, force)
    assert abs(support.stiffness_n_per_m - 9000) < 3 * support.standard_error_n_per_m
    assert support.standard_error_n_per_m < 20
    assert support.force_offset_n == pytest.approx(0.02, abs=0.015)


def test_falling_force_is_refused():
    with pytest.raises(ValueError, match="rise with depth"):
        indenter_support(np.linspace(0, 1e-3, 5), -np.linspace(0, 1, 5))


def test_recorded_blocks_agree_on_one_support(shared_data: Path):
    from ertskin.hardware.recording import read_recording

    supports = []
    for name in ("known_none", "rig_a_train", "rig_b_train"):
        block = read_recording(shared_data / "recordings" / f"{name}.h5").rigid_block
        assert block is not None
        supports.append(indenter_support(block.depth_m, block.force_n))
    assert [s.stiffness_n_per_m for s in supports] == pytest.approx([9000.0] * 3, rel=0.003)

"""Choice of the last checkpoints of stiction.distributed, and files that are none of them."""

import numpy as np
import pytest

from stiction import distributed
from stiction.distributed import Shard


def states_of(shard, value):
    return {"id": shard.ids, "value": np.full(shard.num_envs, value)}


def test_steps_of_ten_digits_are_later_than_those_of_nine(tmp_path):
    shard = Shard(0, 2, 2)
    for step_number in (999_999_998, 999_999_999, 1_000_000_000, 1_000_000_001):
        distributed.save(tmp_path, step_number, states_of(shard, step_number), shard)
        assert distributed.load(tmp_path, shard)[0] == step_number
    assert sorted(int(place.name[5:]) for place in tmp_path.iterdir()) == [1_000_000_000, 1_000_000_001]


def test_what_could_not_be_loaded_is_not_saved(tmp_path):
    shard = Shard(2, 4, 4)
    for states in ({}, {"value": np.zeros(2)}, {"id": np.arange(2)}, {"id": np.arange(2, 5)}):
        with pytest.raises(ValueError, match=r"states: expected 'id' to be 2\.\.3"):
            distributed.save(tmp_path, 1, states, shard)
    with pytest.raises(ValueError, match="step: expected at least 0, got -1"):
        distributed.save(tmp_path, -1, states_of(shard, 1), shard)
    assert not list(tmp_path.iterdir())


def test_other_files_in_a_checkpoints_folder_are_left_alone(tmp_path):
    shard = Shard(0, 2, 2)
    (tmp_path / "step_000000001").mkdir()
    np.savez(tmp_path / "step_000000001" / "policy_best.npz", weights=np.zeros(3))
    for step_number in (1, 2, 3, 4):
        distributed.save(tmp_path, step_number, states_of(shard, step_number), shard)
    assert distributed.load(tmp_path, shard)[0] == 4
    assert (tmp_path / "step_000000001" / "policy_best.npz").exists()

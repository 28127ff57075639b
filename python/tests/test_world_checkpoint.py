"""Checkpoints of worlds: the bits of a run without a stop, and files that do not fit."""

import numpy as np
import pytest
from worlds import started

import stiction


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_world_goes_on_from_a_checkpoint_with_the_same_bits(dtype, tmp_path):
    forces = np.zeros((3, 12, 6), dtype)
    forces[1, 2, 1] = 0.5
    world = started(3, dtype=dtype)
    world.step(forces, 60)
    np.savez(tmp_path / "point.npz", **world.checkpoint())
    world.step(None, 20)
    world.step(forces, 20)
    for device in "cpu", "emulated":
        other = started(3, device, dtype=dtype)
        other.step(forces, 7)
        with np.load(tmp_path / "point.npz") as point:
            other.resume(point)
        assert not other.status["iterations"].any()
        other.step(None, 20)
        other.step(forces, 20)
        assert other.hash() == world.hash()
        assert (other.status == world.status).all()


def test_a_checkpoint_that_does_not_fit_changes_nothing():
    world = started(2)
    world.step(None, 60)
    point, before = world.checkpoint(), world.hash()
    assert len(point["contact_id"]) > 1
    broken = [({k: v for k, v in point.items() if k != "twist"}, "got no twist"),
              (point | {"position": point["position"][:1]}, "position"),
              (point | {"contact_id": point["contact_id"][:-1]}, "impulse"),
              (point | {"contact_id": point["contact_id"][::-1].copy()}, "must be above"),
              (point | {"contact_offsets": point["contact_offsets"] * 0}, "contact_id has"),
              (point | {"impulse": point["impulse"].astype("float32")}, "impulse")]
    for mapping, words in broken:
        with pytest.raises((ValueError, TypeError, stiction.Error), match=words):
            world.resume(mapping)
        assert world.hash() == before
    world.resume(point)
    assert world.hash() == before

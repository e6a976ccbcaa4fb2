"""Another engine, another implementation of contact, the same motions."""

import sys

import numpy as np
import pytest

from dlm.simulator import SimulatorSettings, replay
from tests.support.scenes import lift, push, transverse_push

mujoco = pytest.importorskip("mujoco")
from dlm.simulator.mujoco import MujocoMissing, export_plan, plan_model, replay_in_mujoco, replay_model  # noqa: E402


@pytest.mark.parametrize("case", [push(), lift(), transverse_push()], ids=["push", "lift", "transverse"])
def test_hand_made_plans_end_alike(case):
    ours = replay(case.scene, case.positions, case.forces)
    theirs = replay_in_mujoco(case.scene, case.positions, case.forces)
    assert np.abs(ours.poses - theirs.poses)[:, :2].max() < 2e-4
    assert np.abs(ours.poses - theirs.poses)[:, 2].max() < np.radians(0.2)


def test_an_exported_file_holds_the_whole_plan(tmp_path):
    case = push()
    path = tmp_path / "push.xml"
    export_plan(path, case.scene, case.positions, case.forces)
    assert mujoco.MjModel.from_xml_path(str(path)).nq == 3 + 4
    replayed = replay_model(path.read_text())
    ours = replay(case.scene, case.positions, case.forces)
    np.testing.assert_allclose(replayed.poses[:, :2], ours.poses[:, :2], atol=2e-4)
    np.testing.assert_allclose(replayed.poses[:, 2], ours.poses[:, 2], atol=np.radians(0.2))
    np.testing.assert_allclose(replayed.fingers[::20], ours.fingers[::20], atol=5e-4)


def test_frictionless_scenes_let_the_lift_slip():
    case = lift()
    smooth = SimulatorSettings(frictionless=True)
    theirs = replay_in_mujoco(case.scene, case.positions, case.forces, smooth)
    ours = replay(case.scene, case.positions, case.forces, smooth)
    assert theirs.poses[-1, 1] == pytest.approx(0.02, abs=1e-3)
    assert ours.poses[-1, 1] == pytest.approx(0.02, abs=1e-3)


def test_without_the_package_the_message_names_the_extra(monkeypatch):
    case = push()
    text = plan_model(case.scene, case.positions, case.forces)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MujocoMissing, match=r"certified-manipulation\[mujoco\]"):
        replay_model(text)

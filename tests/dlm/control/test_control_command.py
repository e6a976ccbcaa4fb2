import json
import subprocess
import sys

import pytest

pytest.importorskip("gym_pusht")


def command(*options):
    return subprocess.run([sys.executable, "-m", "dlm.control", *options], capture_output=True, text=True)


def test_episodes_are_kept_and_taken_up_again(tmp_path):
    out = tmp_path / "runs"
    first = command("observation=state", "episodes=2", "seed=40", "videos=1", f"out={out}")
    assert first.returncode == 0, first.stderr
    assert "2 (100.0%)" in first.stdout
    stored = json.loads((out / "results.json").read_text())
    assert [row["seed"] for row in stored["episodes"]] == [40, 41]
    assert set(stored["episodes"][0]) >= {"seed", "success", "steps", "coverage"}
    assert all(row["success"] and row["coverage"] > 0.95 for row in stored["episodes"])
    assert (out / "episode_40.mp4").stat().st_size > 1000
    stored["episodes"][0]["steps"] = 77  # a mark: what is there is not run again
    (out / "results.json").write_text(json.dumps(stored))
    second = command("observation=state", "episodes=3", "seed=40", "videos=0", f"out={out}")
    assert second.returncode == 0, second.stderr
    again = json.loads((out / "results.json").read_text())["episodes"]
    assert [row["seed"] for row in again] == [40, 41, 42]
    assert again[0]["steps"] == 77


@pytest.mark.parametrize(
    ("option", "complaint"),
    [
        ("world=moon", "world: expected pusht"),
        ("light=2", "light"),
    ],
)
def test_bad_input_is_one_line(tmp_path, option, complaint):
    done = command(option, f"out={tmp_path / 'x'}")
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "x").exists()


def test_results_of_another_trial_are_left_alone(tmp_path):
    (tmp_path / "results.json").write_text('{"trial": {"observation": "pixels"}, "episodes": []}')
    done = command("observation=state", "episodes=1", f"out={tmp_path}")
    assert done.returncode == 2
    assert "another folder" in done.stderr
    assert "pixels" in (tmp_path / "results.json").read_text()

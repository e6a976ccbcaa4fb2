"""The command line: bad input ends with one line, code 2, and everything on disk as it was."""

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from datasets.generate import main
from datasets.store import read_dataset

BAD = {
    "unknown data set": (["dataset=nonsense"], "dataset/nonsense"),
    "unknown key": (["colour=red"], "colour"),
    "unknown setting": (["+dataset.shapes.corners=4"], "corners"),
    "negative seed": (["seed=-1"], "seed: expected a whole number >= 0, got -1"),
    "no process": (["jobs=0"], "jobs: expected a number of processes, or -1 for all cores, got 0"),
    "unknown backend": (["backend=slurm"], "backend: expected loky or ray, got slurm"),
    "no task": (["dataset.count=0"], "dataset.count: expected a whole number from 1 to 10000000, got 0"),
    "two-sided polygon": (["dataset.shapes.facets=[2,3]"], "shapes.facets: expected whole numbers 3 <= least"),
    "negative mass": (["dataset.tasks.mass=-0.1"], "tasks.mass: expected a positive number of kilograms, at most 1000000, got -0.1"),
    "negative friction": (["dataset.tasks.friction=-1"], "friction: expected"),
    "blind camera": (["dataset.camera.scale=nan"], "camera.scale: expected a positive number"),
    "folder of other things": (["out={other}"], "out: expected a new or empty folder, or a data set, got"),
    "a file for a folder": (["out={other}/note.txt"], "out: expected a new or empty folder, or a data set, got"),
    "other settings": (["out={made}", "dataset.shapes.facets=[5,5]"], "of other count, shard, shapes.facets; choose"),
}  # fmt: skip


@pytest.fixture(scope="module")
def answers(
    made: Path, contents: Callable[[Path], dict[str, bytes]], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, tuple[int, str, str]]:
    """Exit code, stdout, stderr of every case; they run side by side."""
    place = tmp_path_factory.mktemp("commands")
    other = place / "other"
    other.mkdir()
    (other / "note.txt").write_text("mine")
    before = contents(made)
    jobs = {}
    for name, (overrides, _) in BAD.items():
        arguments = [
            f"out={place}/new",
            "dataset=smoke",
            *(o.format(other=other, made=made) for o in overrides),
        ]
        named = {a.split("=")[0]: a for a in arguments}  # a later override replaces an earlier one
        command = [sys.executable, "-m", "datasets.generate", *named.values()]
        jobs[name] = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if len(jobs) % 4 == 0:
            jobs[name].wait()
    results = {name: (*job.communicate(), job.returncode) for name, job in jobs.items()}
    assert contents(made) == before
    assert contents(other) == {"note.txt": b"mine"}
    assert not (place / "new").exists()
    return {name: (code, out, err) for name, (out, err, code) in results.items()}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_line_and_code_2(case: str, answers: dict[str, tuple[int, str, str]]) -> None:
    code, out, err = answers[case]
    assert code == 2
    assert out == ""
    assert len(err.splitlines()) == 1, err
    assert err.startswith("error: ")
    assert BAD[case][1] in err


@pytest.mark.skipif(importlib.util.find_spec("ray") is not None, reason="Ray is installed")
def test_ray_is_asked_for_where_it_is_missing(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "datasets.generate",
        "dataset=smoke",
        "backend=ray",
        f"out={tmp_path / 'new'}",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "pip install certified-manipulation[ray]" in done.stderr


def test_a_multirun_makes_a_data_set_for_each_setting(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    swept = ["-m", "dataset=smoke", "dataset.count=1", "dataset.tasks.friction=0.5,0.6", "jobs=1"]
    monkeypatch.setattr(sys, "argv", ["generate.py", *swept])
    main()
    made = {folder.name: read_dataset(folder) for folder in (tmp_path / "data").iterdir()}
    frictions = {name: data[0].task.fingers.friction for name, data in made.items()}
    assert frictions == {f"smoke-seed0,dataset.tasks.friction={mu}": mu for mu in (0.5, 0.6)}

"""The same data whatever happens on the way: number of processes, kills, damaged files."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from datasets.generation import Generation, generate
from datasets.motions import FAMILIES
from datasets.specification import FailedDraw, Specification, draw
from datasets.store import encode_shard, read_dataset, read_manifest, shard_path
from expert.errors import InvalidProblem
from expert.verify.plan.check import check_plan

Contents = Callable[[Path], dict[str, bytes]]


COMMAND = [sys.executable, "-m", "datasets.generate", "dataset=smoke"]


def test_two_processes_make_the_bytes_of_one(
    small: Specification, made: Path, tmp_path: Path, contents: Contents
) -> None:
    generate(Generation(specification=small, seed=0, out=tmp_path / "two", jobs=2))
    assert contents(tmp_path / "two") == contents(made)


@pytest.mark.slow
def test_a_job_killed_twice_ends_with_the_bytes_of_an_undisturbed_one(
    smoke: Specification, tmp_path: Path, contents: Contents
) -> None:
    out = tmp_path / "killed"
    command = [*COMMAND, "dataset.count=48", "dataset.shard=2", f"out={out}", "jobs=2"]
    for wanted in (1, 12):  # kill as soon as so many of the 24 shards are there
        job = subprocess.Popen(command, start_new_session=True)
        while len(list(out.glob("shards/*.npz"))) < wanted:
            assert job.poll() is None, "ended before it could be killed"
            time.sleep(0.002)
        os.killpg(job.pid, signal.SIGKILL)
        assert job.wait() == -signal.SIGKILL
        assert not read_manifest(out)["complete"]
    subprocess.run(command, check=True)
    undisturbed = replace(smoke, count=48, shard=2)
    generate(Generation(specification=undisturbed, seed=0, out=tmp_path / "undisturbed", jobs=1))
    assert contents(out) == contents(tmp_path / "undisturbed")


@pytest.mark.slow
def test_ctrl_c_stops_cleanly_and_says_how_to_go_on(tmp_path: Path) -> None:
    out = tmp_path / "interrupted"
    many = [*COMMAND, "dataset.count=200", "dataset.shard=1", f"out={out}", "jobs=2"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # a shell's background jobs, and their children, ignore Ctrl-C
    heed = partial(signal.signal, signal.SIGINT, signal.default_int_handler)
    job = subprocess.Popen(many, start_new_session=True, preexec_fn=heed, **pipes)
    while job.poll() is None and not list(out.glob("shards/*.npz")):
        time.sleep(0.01)
    os.killpg(job.pid, signal.SIGINT)
    stdout, stderr = job.communicate(timeout=60)
    assert job.returncode == 130
    assert stdout == ""
    assert len(stderr.splitlines()) == 1
    assert f"of 200 shards in {out}; the same command goes on from there" in stderr
    assert not list(out.rglob(".*"))  # no drafts


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def _flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("damage", [Path.unlink, _cut, _flip, lambda p: p.write_bytes(b"")])
def test_an_unfinished_data_set_is_mended_shard_by_shard(
    damage: Callable[[Path], None], small: Specification, made: Path, tmp_path: Path, contents: Contents
) -> None:
    folder = tmp_path / "damaged"
    shutil.copytree(made, folder)
    manifest = read_manifest(folder)
    (folder / "manifest.json").write_text(
        json.dumps(
            {
                k: manifest[k]
                for k in ("schema", "kind", "name", "seed", "settings", "versions", "fingerprint")
            }
            | {"complete": False}
        )
    )
    damage(shard_path(folder, 1))
    (folder / "shards" / ".00001.npz.123").write_bytes(b"draft of a killed run")
    untouched = shard_path(folder, 0).stat().st_mtime_ns
    generate(Generation(specification=small, seed=0, out=folder, jobs=1))
    assert contents(folder) == contents(made)
    assert shard_path(folder, 0).stat().st_mtime_ns == untouched


def test_a_complete_data_set_is_left_alone(small: Specification, made: Path) -> None:
    before = {p: p.stat().st_mtime_ns for p in made.rglob("*")}
    assert generate(Generation(specification=small, seed=0, out=made)) == read_manifest(made)
    assert {p: p.stat().st_mtime_ns for p in made.rglob("*")} == before


def test_other_settings_or_seed_are_refused_by_name_and_destroy_nothing(
    small: Specification, made: Path, contents: Contents
) -> None:
    before = contents(made)
    other = replace(small, labelling=replace(small.labelling, node_limit=7))
    with pytest.raises(
        InvalidProblem, match=r"^out: .*of other seed, labelling.node_limit; .*overwrite=true"
    ):
        generate(Generation(specification=other, seed=1, out=made))
    assert contents(made) == before


def test_overwriting_replaces_all_shards(
    small: Specification, made: Path, tmp_path: Path, contents: Contents
) -> None:
    folder = tmp_path / "old"
    shutil.copytree(made, folder)
    fewer = replace(small, count=2)
    generate(Generation(specification=fewer, seed=1, out=folder, jobs=1, overwrite=True))
    fresh = tmp_path / "fresh"
    generate(Generation(specification=fewer, seed=1, out=fresh, jobs=1))
    assert contents(folder) == contents(fresh)
    assert contents(folder)["shards/00000.npz"] != contents(made)["shards/00000.npz"]


def test_an_unfinished_data_set_of_other_code_is_refused(
    small: Specification, made: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "old"
    folder.mkdir()
    manifest = read_manifest(made)
    manifest |= {"complete": False, "versions": manifest["versions"] | {"code": "0" * 16}}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InvalidProblem, match=r"^out: .*of the installed versions, got .* of other code;"):
        generate(Generation(specification=small, seed=0, out=folder))


def test_families_come_in_equal_parts_and_every_label_is_sound_again_when_read_back(made: Path) -> None:
    data = read_dataset(made)
    samples = [data[i] for i in range(len(data))]
    assert [s.family for s in samples] == list(FAMILIES)
    for sample in samples:
        assert check_plan(sample.task, sample.plan).verdict == "sound"


def test_failed_draws_are_counted_by_reason(smoke: Specification, tmp_path: Path) -> None:
    """Hardly any friction: not every lift has a plan, and the manifest says how many have none and which."""
    slippery = replace(smoke, count=4, shard=4, tasks=replace(smoke.tasks, friction=0.05))
    manifest = generate(Generation(specification=slippery, seed=0, out=tmp_path / "slippery", jobs=1))
    failed = manifest["failed_draws"]
    assert manifest["failures"].get("infeasible", 0) > 0
    assert manifest["draws"] == manifest["tasks"] + len(failed) == 4 + sum(manifest["failures"].values())
    assert "unsound" not in manifest["failures"]
    data = read_dataset(tmp_path / "slippery")
    for i in range(4):
        assert data[i].attempt == sum(f["index"] == i for f in failed)
    again, failures = draw(slippery, 0, failed[0]["index"])
    assert [vars(f) for f in failures] == [f for f in failed if f["index"] == again.index]


def test_shards_hold_no_clock(small: Specification, made: Path) -> None:
    data = read_dataset(made)
    failed = [FailedDraw(index=0, attempt=0, family="slide", reason="infeasible", detail="x")]
    first = encode_shard([data[0]], failed, small, "f")
    time.sleep(2.1)  # zip entries tell time in steps of two seconds
    assert encode_shard([data[0]], failed, small, "f") == first


def test_a_data_set_that_another_process_makes_is_left_alone(small: Specification, tmp_path: Path) -> None:
    hold = "import sys, time; from expert.files.output import claimed\nwith claimed(sys.argv[1]): print('held', flush=True); time.sleep(60)"
    out = tmp_path / "shared"
    with subprocess.Popen([sys.executable, "-c", hold, str(out)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with pytest.raises(InvalidProblem, match=f"shared, which process {other.pid} is about to write"):
            generate(Generation(specification=small, seed=0, out=out, jobs=1))
        assert not out.exists()
        other.kill()
    first = replace(small, count=1)
    assert generate(Generation(specification=first, seed=0, out=out, jobs=1))["complete"]
    assert not list(tmp_path.glob(".*"))

"""What is written is read back; what is broken is refused in one line that names file and field."""

import contextlib
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from datasets.card import card, field_table
from datasets.fields import FIELDS
from datasets.parameters import MechanicalParameters, parameters_of
from datasets.render import render
from datasets.specification import Specification, draw
from datasets.store import decode_shard, read_dataset, read_manifest, sha256, shard_path
from expert.errors import InvalidProblem


def test_a_stored_sample_is_the_drawn_one(small: Specification, made: Path) -> None:
    data = read_dataset(made)
    for i in (1, 5):
        read, (drawn, _) = data[i], draw(small, 0, i)
        assert (read.index, read.attempt, read.family) == (drawn.index, drawn.attempt, drawn.family)
        assert np.array_equal(read.video, drawn.video)
        assert read.task.fingers == drawn.task.fingers
        assert read.task.environment.gravity == drawn.task.environment.gravity
        assert read.task.robustness.min_normal_force == pytest.approx(
            drawn.task.robustness.min_normal_force, rel=1e-15
        )
        assert np.array_equal(read.task.body.vertices, drawn.task.body.vertices)
        assert np.array_equal(read.task.trajectory.extended, drawn.task.trajectory.extended)
        for name in ("status", "objective", "bound", "nodes", "residual"):
            assert getattr(read.plan, name) == getattr(drawn.plan, name), name
        for name in ("modes", "positions", "forces"):
            assert np.array_equal(getattr(read.plan, name), getattr(drawn.plan, name)), name
        assert len(read.plan.contact_forces) == len(drawn.plan.contact_forces) > 0
        for a, b in zip(read.plan.contact_forces, drawn.plan.contact_forces, strict=True):
            assert (a.step, a.vertex, a.wall) == (b.step, b.vertex, b.wall)
            assert np.array_equal([a.point, a.force], [b.point, b.force])


def test_parameters_and_videos_follow_from_the_stored_tasks_and_plans(made: Path) -> None:
    data = read_dataset(made)
    for i in range(len(data)):
        sample = data[i]
        again = parameters_of(sample.task, sample.plan)
        for f in fields(MechanicalParameters):
            assert np.allclose(getattr(again, f.name), getattr(sample.parameters, f.name), atol=1e-15), f.name
        assert np.array_equal(render(sample.task.body.vertices, sample.task.trajectory.poses), sample.video)


def test_manifest_and_card_tell_what_is_there(made: Path) -> None:
    manifest, data = read_manifest(made), read_dataset(made)
    assert manifest["tasks"] == len(data) == 6
    assert manifest["sha256"] == data.sha256
    assert sum(manifest["statuses"].values()) == 6
    assert [s["tasks"] for s in manifest["shards"]] == [2, 2, 2]
    text = (made / "README.md").read_text()
    assert text == card(manifest)
    assert "6 manipulation tasks" in text
    assert all(f"| `{name}` |" in text for name in FIELDS)
    assert field_table() in (Path(__file__).parents[2] / "docs" / "datasets.md").read_text()


def _set_manifest(**changes: Any) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        manifest = json.loads((folder / "manifest.json").read_text()) | changes
        (folder / "manifest.json").write_text(json.dumps(manifest))

    return edit


def _set_array(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    """Alter a shard's arrays, checksum and all."""

    def edit(folder: Path) -> None:
        path = shard_path(folder, 1)
        with np.load(path) as archive:
            arrays = dict(archive)
        change(arrays)
        np.savez_compressed(path, **arrays)
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest["shards"][1]["sha256"] = sha256(path.read_bytes())
        (folder / "manifest.json").write_text(json.dumps(manifest))

    return edit


def _nan_frame(arrays: dict[str, Any]) -> None:
    arrays["video"] = arrays["video"].astype(float)
    arrays["video"][1, 2, 7] = np.nan


def _nan_force(arrays: dict[str, Any]) -> None:
    arrays["forces"][1, 4, 0, 1] = np.inf


def _old_schema(arrays: dict[str, Any]) -> None:
    arrays["about"] = np.array(json.dumps(json.loads(str(arrays["about"])) | {"schema": 0}))


BROKEN = {
    "no folder": (shutil.rmtree, r"small: expected a data set \(manifest.json\), got none; make one"),
    "empty": (_set_manifest(shards=[]), r"manifest.json shards: expected settings and at least one shard, got an empty data set"),
    "unfinished": (_set_manifest(complete=False), r"manifest.json complete: expected a finished data set"),
    "schema": (_set_manifest(schema=99), r"manifest.json schema: expected 1 of .*got 99"),
    "manifest cut": (lambda f: (f / "manifest.json").write_text('{"schema": 1'), r"manifest.json: expected a manifest in JSON"),
    "manifest of a list": (lambda f: (f / "manifest.json").write_text("[]"), r"manifest.json: expected a manifest in JSON"),
    "manifest without its entries": (lambda f: (f / "manifest.json").write_text('{"schema": 1, "kind": "manipulation tasks", "complete": true}'), r"manifest.json shards: expected settings and at least one shard"),
    "shard gone": (lambda f: shard_path(f, 1).unlink(), r"00001.npz: expected a shard, got No such file"),
    "shard cut": (lambda f: shard_path(f, 1).write_bytes(shard_path(f, 1).read_bytes()[:999]), r"00001.npz: expected \d+ bytes of checksum \w+, got 999 bytes"),
    "shard schema": (_set_array(_old_schema), r"00001.npz: expected schema 1, got 0"),
    "nan frame": (_set_array(_nan_frame), r"00001.npz video: expected finite numbers, got nan at \(1, 2, 7, 0, 0\)"),
    "inf force": (_set_array(_nan_force), r"00001.npz forces: expected finite numbers, got inf at \(1, 4, 0, 1\)"),
    "float frames": (_set_array(lambda a: a.update(video=a["video"] / 1.0)), r"00001.npz video: expected type unsigned integer, shape \(2, .*got float64"),
    "field gone": (_set_array(lambda a: a.pop("modes")), r"00001.npz modes: expected a field of this name, got none"),
    "short field": (_set_array(lambda a: a.update(modes=a["modes"][:1])), r"00001.npz modes: expected type integer, shape \(2, 5, 2\), got int64, \(1, 5, 2\)"),
    "other padding": (_set_array(lambda a: a.update(vertices=a["vertices"][:, :5])), r"small vertices: expected one shape in all shards"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_data_set_is_refused_in_one_line(case: str, made: Path, tmp_path: Path) -> None:
    damage, message = BROKEN[case]
    folder = tmp_path / "small"
    shutil.copytree(made, folder)
    damage(folder)
    with pytest.raises(InvalidProblem, match=message) as refusal:
        read_dataset(folder)
    assert "\n" not in str(refusal.value)


def test_a_stored_polygon_that_crosses_itself_or_negative_mass_makes_no_task(made: Path) -> None:
    data = read_dataset(made)
    data.arrays["mass"][0] = -1.0
    with pytest.raises(InvalidProblem, match=r"object.mass: expected a positive number, got -1.0"):
        data[0]
    data.arrays["vertices"][1, [1, 2]] = data.arrays["vertices"][1, [2, 1]]
    with pytest.raises(InvalidProblem, match=r"object.vertices: expected a simple polygon"):
        data[1]


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(start=st.floats(0, 1), length=st.integers(1, 64), filler=st.binary(min_size=64, max_size=64))
def test_no_damage_to_a_shard_passes_unseen_or_escapes_as_another_error(
    start: float, length: int, filler: bytes, made: Path
) -> None:
    """Even without the manifest's checksum: whatever is decoded has the true arrays."""
    data = shard_path(made, 0).read_bytes()
    at = int(start * len(data))
    broken = data[:at] + filler[:length] + data[at + length :]
    _, truth = decode_shard(data, "truth")
    arrays = truth
    with contextlib.suppress(InvalidProblem):
        _, arrays = decode_shard(broken, "broken")
    assert all(np.array_equal(arrays[name], truth[name]) for name in FIELDS)


def test_pickled_objects_are_never_loaded(made: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        content = io.BytesIO()
        np.save(content, np.array([{"a": 1}], dtype=object), allow_pickle=True)
        archive.writestr("about.npy", content.getvalue())
    with pytest.raises(InvalidProblem, match=r"evil: expected a whole shard"):
        decode_shard(buffer.getvalue(), "evil")

"""What is written is read back; what is broken is refused in one line that names file and field."""

import contextlib
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from datasets.fields import FIELDS
from datasets.store import decode_shard, read_dataset, sha256, shard_path
from expert.errors import InvalidProblem


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

"""Data sets on disk: a folder of compressed shards and one JSON manifest, each file replaced whole or not at all.

    <folder>/manifest.json       what was asked for, by which versions, what came of it, checksums
    <folder>/shards/00000.npz    samples as padded arrays, and the draws that failed

The bytes of a shard depend on specification, seed and versions alone: zip entries carry no clock.
"""

import hashlib
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from datasets.fields import FIELDS, arrays_of, sample_of
from datasets.motions import TaskSettings
from datasets.specification import FailedDraw, Sample, Specification
from expert.errors import InvalidProblem
from expert.files.output import folder, write_atomically

SCHEMA = 1
KIND = "manipulation tasks"
MANIFEST = "manifest.json"

Arrays = dict[str, np.ndarray[Any, Any]]
Manifest = dict[str, Any]


def shard_path(folder: Path, shard: int) -> Path:
    """File of a shard."""
    return folder / "shards" / f"{shard:05d}.npz"


def write_whole(path: Path, data: bytes) -> None:
    """Replace a file at once: whoever is killed here leaves the old file or the new one.  Raises InvalidProblem."""
    with folder(path.parent):
        write_atomically(path, data)


def sha256(data: bytes) -> str:
    """Checksum in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def encode_shard(
    samples: list[Sample], failed: Iterable[FailedDraw], specification: Specification, fingerprint: str
) -> bytes:
    """A shard as the bytes of an npz file.  Equal samples give equal bytes."""
    about = {"schema": SCHEMA, "fingerprint": fingerprint, "failed": [asdict(draw) for draw in failed]}
    arrays = {"about": np.array(json.dumps(about)), **arrays_of(samples, specification.shapes.facets[1])}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            content = io.BytesIO()
            np.lib.format.write_array(content, array, allow_pickle=False)
            archive.writestr(entry, content.getvalue())
    return buffer.getvalue()


def decode_shard(data: bytes, source: str) -> tuple[dict[str, Any], Arrays]:
    """What the shard says about itself, and its arrays.  Raises InvalidProblem, naming `source` and field."""
    try:
        arrays = _unzip(data)
        about = json.loads(str(arrays.pop("about")))
        schema = about["schema"]
    except UNREADABLE as error:
        raise InvalidProblem(
            source,
            expected="a whole shard (npz)",
            got=f"{len(data)} bytes that cannot be read ({type(error).__name__})",
            remedy="delete it and run datasets.generate again",
        ) from error
    if schema != SCHEMA:
        raise InvalidProblem(
            source, expected=f"schema {SCHEMA}", got=f"{schema!r}", remedy="generate it anew"
        )
    _check_arrays(arrays, source)
    return about, arrays


UNREADABLE = (
    *(OSError, EOFError, ValueError, KeyError, TypeError, RuntimeError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)
"""What reading damaged zip, npy and JSON data can raise."""


def _unzip(data: bytes) -> Arrays:
    """Each entry is read whole, checksum and all, before its header is believed; objects are never unpickled."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        contents = {name.removesuffix(".npy"): archive.read(name) for name in archive.namelist()}
    return {
        name: np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
        for name, content in contents.items()
    }


def _check_arrays(arrays: Arrays, source: str) -> None:
    """Every field there, of its type and shape, and finite; the first field tells the number of samples and steps."""
    sizes: dict[str, int] = {}
    for name, field in FIELDS.items():
        array = arrays.get(name)
        if array is None:
            raise InvalidProblem(f"{source} {name}", expected="a field of this name", got="none")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
            raise InvalidProblem(
                f"{source} {name}", expected="finite numbers", got=f"{array[where]} at {where}"
            )
        fits = array.dtype.kind == field.kind and array.ndim == len(field.axes)
        if not fits or any(
            sizes.setdefault(axis, n) != n for axis, n in zip(field.axes, array.shape, strict=True)
        ):
            wanted = ", ".join(str(sizes.get(axis, axis)) for axis in field.axes)
            raise InvalidProblem(
                f"{source} {name}",
                expected=f"type {KINDS[field.kind]}, shape ({wanted})",
                got=f"{array.dtype}, {array.shape}",
            )


KINDS = {"u": "unsigned integer", "i": "integer", "f": "float", "U": "text"}


def write_manifest(folder: Path, manifest: Mapping[str, object]) -> None:
    """Replace the manifest of a data set."""
    write_whole(folder / MANIFEST, (json.dumps(manifest, indent=1) + "\n").encode())


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a data set, complete or not.  Raises InvalidProblem."""
    path = folder / MANIFEST
    try:
        manifest = json.loads(path.read_bytes())
        kind, schema = manifest["kind"], manifest["schema"]
    except FileNotFoundError as error:
        raise InvalidProblem(
            str(folder),
            expected=f"a data set ({MANIFEST})",
            got="none",
            remedy="make one with python -m datasets.generate",
        ) from error
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InvalidProblem(
            str(path),
            expected="a manifest in JSON",
            got=f"a file that cannot be read ({type(error).__name__})",
        ) from error
    if kind != KIND or schema != SCHEMA:
        raise InvalidProblem(
            f"{path} schema",
            expected=f"{SCHEMA} of {KIND}",
            got=f"{schema!r} of {kind!r}",
            remedy="generate it anew",
        )
    return manifest


@dataclass(frozen=True)
class DataSet:
    """A complete data set in memory: arrays by field name (see FIELDS), samples along their first axis."""

    folder: Path
    manifest: Manifest
    arrays: Arrays

    def __len__(self) -> int:
        return len(self.arrays["index"])

    def __getitem__(self, i: int) -> Sample:
        """Sample i with its task, plan and parameters rebuilt."""
        tasks = TaskSettings(**self.manifest["settings"]["tasks"])
        return sample_of({name: array[i] for name, array in self.arrays.items()}, tasks)

    @property
    def sha256(self) -> str:
        """Fingerprint of the data."""
        return str(self.manifest["sha256"])


def read_dataset(folder: str | Path) -> DataSet:
    """Read and check a whole data set.

    Raises InvalidProblem, naming file and field: missing, incomplete or empty data set, wrong schema, shard that is
    missing, cut short or altered, field that is missing, of wrong shape or not finite.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    if not manifest.get("complete"):
        raise InvalidProblem(
            f"{folder / MANIFEST} complete",
            expected="a finished data set",
            got="an unfinished one",
            remedy="run its python -m datasets.generate command again to finish it",
        )
    if not (manifest.get("shards") and manifest.get("settings")):
        raise InvalidProblem(
            f"{folder / MANIFEST} shards", expected="settings and at least one shard", got="an empty data set"
        )
    parts = [_read_part(folder, entry) for entry in manifest["shards"]]
    return DataSet(folder, manifest, {name: _join(folder, name, parts) for name in FIELDS})


def _read_part(folder: Path, entry: Mapping[str, Any]) -> Arrays:
    path = folder / str(entry["file"])
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidProblem(
            str(path),
            expected="a shard",
            got=error.strerror or "no file",
            remedy="run datasets.generate again",
        ) from error
    if sha256(data) != entry["sha256"]:
        raise InvalidProblem(
            str(path),
            expected=f"{entry['bytes']} bytes of checksum {entry['sha256'][:12]}",
            got=f"{len(data)} bytes of checksum {sha256(data)[:12]}",
            remedy="it was cut short or altered: delete it and run datasets.generate again",
        )
    return decode_shard(data, str(path))[1]


def _join(folder: Path, name: str, parts: list[Arrays]) -> np.ndarray[Any, Any]:
    shapes = {part[name].shape[1:] for part in parts}
    if len(shapes) > 1:
        raise InvalidProblem(f"{folder} {name}", expected="one shape in all shards", got=f"{sorted(shapes)}")
    return np.concatenate([part[name] for part in parts])

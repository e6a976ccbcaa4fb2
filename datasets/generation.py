"""Making a data set in parallel, shard by shard, so that a job killed at any moment goes on where it stopped."""

import functools
import platform
import sys
from collections import Counter
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

import datasets
import expert
from datasets.card import card
from datasets.motions import FAMILIES
from datasets.parallel import Backend, progress_bar, side_by_side
from datasets.specification import Specification, draw
from datasets.store import (
    KIND,
    MANIFEST,
    SCHEMA,
    Manifest,
    decode_shard,
    encode_shard,
    read_manifest,
    sha256,
    shard_path,
    write_manifest,
    write_whole,
)
from expert.errors import InvalidProblem
from expert.files.output import claimed
from expert.world.values import require

PACKAGES = ("certified-manipulation", "numpy", "scipy", "shapely", "numba", "opencv-python-headless")


@dataclass(frozen=True, kw_only=True)
class Generation:
    """One run of the job.

    out: the data set's folder.  jobs: processes (-1: all cores).  backend: loky (this machine) or ray (a cluster).
    overwrite: replace a data set that was made otherwise.
    """

    specification: Specification
    seed: int
    out: Path
    jobs: int = 2
    backend: Backend = "loky"
    overwrite: bool = False

    def __post_init__(self) -> None:
        require(
            isinstance(self.seed, int) and 0 <= self.seed < 2**63, "seed", "a whole number >= 0", self.seed
        )
        require(
            isinstance(self.jobs, int) and (self.jobs >= 1 or self.jobs == -1),
            "jobs",
            "a number of processes, or -1 for all cores",
            self.jobs,
        )
        require(self.backend in ("loky", "ray"), "backend", "loky or ray", self.backend)

    def request(self) -> Manifest:
        """The head of the manifest: what is asked for, and of which versions."""
        head = {
            "schema": SCHEMA,
            "kind": KIND,
            "name": self.specification.name,
            "seed": self.seed,
            "settings": _plain(self.specification.settings()),
            "versions": versions(),
        }
        return {**head, "fingerprint": sha256(repr(head).encode())[:16]}


@functools.cache
def versions() -> dict[str, str]:
    """Python, packages, and a checksum of the code that decides the data."""
    sources = [p for package in (expert, datasets) for p in sorted(Path(package.__path__[0]).rglob("*.py"))]
    code = sha256(b"".join(path.read_bytes() for path in sources))[:16]
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}, "code": code}


def _plain(value: Any) -> Any:
    """Tuples as lists, as JSON reads them back."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple | list) else value


def generate(job: Generation) -> Manifest:
    """Make the data set, or what is missing of it; returns its manifest.

    Nothing is done to a complete data set of the same settings and seed.  Raises InvalidProblem where `out` holds
    anything else or another process is at it, SolverFailed where a task cannot be labelled or a worker dies.
    """
    with claimed(job.out):
        return _generate(job)


def _generate(job: Generation) -> Manifest:
    request = job.request()
    if (done := _prepare(job, request)) is not None:
        return done
    missing = [k for k in range(job.specification.shards) if not _is_made(job.out, k, request["fingerprint"])]
    _make(job, missing, request["fingerprint"])
    manifest = _summary(job, request)
    _remove_leftovers(job)
    write_whole(job.out / "README.md", card(manifest).encode())
    write_manifest(job.out, manifest)
    return manifest


def _prepare(job: Generation, request: Manifest) -> Manifest | None:
    """Claim the folder for this request.  Returns the manifest if all is done already."""
    if not job.out.exists() or (job.out.is_dir() and not any(job.out.iterdir())):
        write_manifest(job.out, {**request, "complete": False})
        return None
    if not (job.out / MANIFEST).is_file():
        raise InvalidProblem(
            "out",
            expected="a new or empty folder, or a data set",
            got=f"{job.out} with other content",
            remedy="choose another out=",
        )
    found = read_manifest(job.out)
    differences = _differences(found, request)
    if job.overwrite and (differences or found["versions"] != request["versions"]):
        write_manifest(job.out, {**request, "complete": False})
        return None
    if differences:
        raise InvalidProblem(
            "out",
            expected="a data set of these settings",
            got=f"{job.out} of other {', '.join(differences)}",
            remedy="choose another out=, or overwrite=true",
        )
    if found["complete"]:
        return found
    if found["versions"] != request["versions"]:
        changed = _differences(found["versions"], request["versions"])
        raise InvalidProblem(
            "out",
            expected="an unfinished data set of the installed versions",
            got=f"{job.out} of other {', '.join(changed)}",
            remedy="overwrite=true makes it anew",
        )
    return None


def _differences(found: Any, wanted: Any, prefix: str = "") -> list[str]:
    """Dotted names of the settings (or versions) that differ."""
    if not prefix and "settings" in wanted:
        found, wanted = ({"seed": m["seed"], **m["settings"]} for m in (found, wanted))
    if not (isinstance(found, dict) and isinstance(wanted, dict)):
        return [] if found == wanted else [prefix.rstrip(".")]
    names = dict.fromkeys([*wanted, *found])
    return [
        line for name in names for line in _differences(found.get(name), wanted.get(name), f"{prefix}{name}.")
    ]


def _is_made(folder: Path, shard: int, fingerprint: str) -> bool:
    """Whether the shard is there, whole, and made for this request."""
    path = shard_path(folder, shard)
    try:
        about, _ = decode_shard(path.read_bytes(), str(path))
    except (FileNotFoundError, InvalidProblem):
        return False
    return bool(about["fingerprint"] == fingerprint)


def make_shard(job: Generation, shard: int, fingerprint: str) -> tuple[int, bytes]:
    """A shard's number and bytes."""
    specification = job.specification
    with threadpool_limits(1):  # the sums of a threaded BLAS may depend on the number of threads
        drawn = [draw(specification, job.seed, index) for index in specification.indices(shard)]
    failed = [failure for _, failures in drawn for failure in failures]
    return shard, encode_shard([sample for sample, _ in drawn], failed, specification, fingerprint)


def _make(job: Generation, missing: list[int], fingerprint: str) -> None:
    """Make and store the missing shards, in whatever order they come."""
    total = job.specification.count
    done = total - sum(len(job.specification.indices(k)) for k in missing)
    calls = [functools.partial(make_shard, job, k, fingerprint) for k in missing]
    try:
        with progress_bar(f"{job.specification.name}: tasks", total, done) as show:
            for shard, data in side_by_side(calls, jobs=job.jobs, backend=job.backend):
                write_whole(shard_path(job.out, shard), data)
                done += len(job.specification.indices(shard))
                show(done)
    except KeyboardInterrupt:
        made = sum(_is_made(job.out, k, fingerprint) for k in range(job.specification.shards))
        print(
            f"interrupted with {made} of {job.specification.shards} shards in {job.out}; "
            "the same command goes on from there",
            file=sys.stderr,
        )
        raise


def _summary(job: Generation, request: Manifest) -> Manifest:
    """The whole manifest, from what is stored."""
    shards: list[dict[str, Any]] = []
    failed: list[dict[str, Any]] = []
    statuses, kept = Counter[str](), 0
    for k in range(job.specification.shards):
        path = shard_path(job.out, k)
        data = path.read_bytes()
        about, arrays = decode_shard(data, str(path))
        name = path.relative_to(job.out).as_posix()
        shards.append(
            {"file": name, "tasks": len(arrays["index"]), "bytes": len(data), "sha256": sha256(data)}
        )
        failed += about["failed"]
        statuses.update(arrays["status"].tolist())
        kept += int((arrays["min_normal_force"] > 0).sum())
    tasks = sum(shard["tasks"] for shard in shards)
    by_family = {name: dict(Counter(f["reason"] for f in failed if f["family"] == name)) for name in FAMILIES}
    return {
        **request,
        "complete": True,
        "tasks": tasks,
        "draws": tasks + len(failed),
        "statuses": dict(sorted(statuses.items())),
        "least_push_kept": kept,
        "failures": dict(sorted(Counter(f["reason"] for f in failed).items())),
        "failures_by_family": by_family,
        "sha256": sha256("".join(shard["sha256"] for shard in shards).encode()),
        "shards": shards,
        "failed_draws": failed,
    }


def _remove_leftovers(job: Generation) -> None:
    """Shards beyond the last one, of the data set that this one overwrites, and drafts of killed runs."""
    wanted = {shard_path(job.out, k).name for k in range(job.specification.shards)}
    for path in [*(job.out / "shards").glob("*.npz"), *(job.out / "shards").glob(".*.npz.*")]:
        if path.name not in wanted:
            path.unlink()

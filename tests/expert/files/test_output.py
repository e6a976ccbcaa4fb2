"""Results reach their file whole or not at all, no other process interferes, and none is lost where the place fails."""

import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from expert.errors import InvalidProblem
from expert.files.output import Output, writable, write_atomically

HOLDING = """
import sys
from expert.files.output import Output
with Output(sys.argv[1]) as output:
    print("held", flush=True)
    sys.stdin.readline()
    output.write(b"theirs")
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_replaced_whole_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    for content in (b"long" * 1000, b"short"):
        write_atomically(path, content)
        assert path.read_bytes() == content
    assert names(tmp_path) == ["s.json"]
    assert path.stat().st_mode & 0o666 == 0o666 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_an_older_file_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    path.write_text("precious")
    with pytest.raises(RuntimeError, match="the work failed"), Output(path):
        raise RuntimeError("the work failed")
    writable(path)
    assert path.read_text() == "precious"
    assert names(tmp_path) == ["s.json"]


def test_a_link_keeps_pointing_to_what_is_replaced(tmp_path: Path) -> None:
    path, link = tmp_path / "s.json", tmp_path / "link.json"
    path.write_text("old")
    link.symlink_to(path)
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert path.read_text() == "new"


def test_what_cannot_be_written_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "kept.json").write_text("precious")
    (tmp_path / "kept.json").chmod(0o444)
    for path, complaint in (
        (tmp_path, "writable folder"),
        (tmp_path / "absent" / "s.json", "create the folder"),
        (tmp_path / "kept.json" / "s.json", "writable folder"),
        (tmp_path / "kept.json", "read-only"),
        (Path("/dev/null"), "no file"),
        (tmp_path / ("x" * 300), "too long"),
        (Path("a\0b"), "null"),
    ):
        with pytest.raises(InvalidProblem, match=f"^output: .*{complaint}") as caught:
            writable(path)
        assert "\n" not in str(caught.value)
    assert (tmp_path / "kept.json").read_text() == "precious"
    assert names(tmp_path) == ["kept.json"]


def test_a_full_disk_is_noticed_before_the_work(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(InvalidProblem, match=r"^output: expected a place to write, got File too large"):
            writable(tmp_path / "s.json")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert names(tmp_path) == []


def test_a_result_whose_place_is_gone_is_kept_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, spare = tmp_path / "gone", tmp_path / "spare"
    folder.mkdir()
    spare.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(spare))
    with Output(folder / "s.json") as output:
        shutil.rmtree(folder)
        with pytest.raises(InvalidProblem, match=r"the result is kept in .*/spare/s-") as caught:
            output.deliver(b'{"status": "optimal"}')
    (kept,) = spare.iterdir()
    assert str(kept) in str(caught.value)
    assert json.loads(kept.read_text()) == {"status": "optimal"}


def test_a_result_that_no_folder_takes_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with Output(tmp_path / "s.json") as output:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
        try:
            with pytest.raises(InvalidProblem, match="the result is kept on standard output"):
                output.deliver(b"x" * 2000)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert capsys.readouterr().out == "x" * 2000
    assert names(tmp_path) == []


def test_two_processes_on_one_output_notice_each_other(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    command = [sys.executable, "-c", HOLDING, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        what = (
            f"^output: expected a file that no other process writes, got {path}, which process {other.pid} "
        )
        with pytest.raises(InvalidProblem, match=what):
            writable(path)
        writable(tmp_path / "another.json")
        other.communicate("\n", timeout=60)
    assert path.read_text() == "theirs"
    assert names(tmp_path) == ["s.json"]


def test_a_process_that_was_killed_blocks_nobody(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    command = [sys.executable, "-c", HOLDING, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        other.stdout.readline()
        other.kill()
    write_atomically(path, b"ours")
    assert path.read_text() == "ours"

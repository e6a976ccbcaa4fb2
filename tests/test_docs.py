"""Documents tell the truth about the code: equations stand where the table says, links and named tests exist."""

import ast
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

from expert.files import FORMATS, read_problem
from expert.files.section import Section

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CHANGELOG.md"])
ROW = re.compile(
    r"^\| (?P<label>[^|]+?) \| [^|]+ \| `(?P<file>[^`|]+)` \| `(?P<name>[^`|]+)` \|$", re.MULTILINE
)
EQUATIONS = [
    m.group("label", "file", "name") for m in ROW.finditer((ROOT / "docs/architecture.md").read_text())
]
LABELS = {
    *(f"3-CT{k}" for k in range(1, 10)), "3-MIQP1",
    *(f"4-CT{k}" for k in range(1, 11)),
    *(f"5-CT{k}" for k in range(1, 20)), "5-MIP1", "5-MIQP1", "5-MIQP2",
    *(f"5.1 {name}" for name in ("Definition 1", "Definition 2", "Remark 1", "Remark 2", "Theorem 1")),
    *(f"5.1 Lemma {k}" for k in range(1, 5)),
    *(f"5.2 {name}" for name in ("Problem 1", "Definition 1", "Definition 2", "Corollary 1")),
    *(f"5.2 Remark {k}" for k in range(1, 5)),
}  # fmt: skip
"""All numbered statements of Chapters 3.1, 4 and 5 of the thesis; programs carry the chapter's number as equations do."""


@cache
def definitions(file: str) -> dict[str, str]:
    """Source of every function and class of a file by its name, methods as Class.method."""
    text = (ROOT / file).read_text()
    found: dict[str, str] = {}

    def visit(nodes: list[ast.stmt], prefix: str) -> None:
        for node in nodes:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found[prefix + node.name] = ast.get_source_segment(text, node) or ""
                if isinstance(node, ast.ClassDef):
                    visit(node.body, f"{prefix}{node.name}.")

    visit(ast.parse(text).body, "")
    return found


def test_every_label_of_the_thesis_has_a_row() -> None:
    assert {label for label, _, _ in EQUATIONS} == LABELS


@pytest.mark.parametrize(("label", "file", "name"), EQUATIONS, ids=[label for label, _, _ in EQUATIONS])
def test_an_equation_stands_where_the_table_says(label: str, file: str, name: str) -> None:
    assert (ROOT / file).is_file()
    assert name in definitions(file)
    assert re.search(rf"{re.escape(label)}(?!\d)", definitions(file)[name]), f"{label} is not in {name}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", page.read_text()):
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), target
        if anchor:
            assert anchor in anchors(path), target


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_index_lists_every_page() -> None:
    index = (ROOT / "docs/README.md").read_text()
    listed = {(ROOT / "docs" / target).resolve() for target in re.findall(r"\]\(([^)#]+)", index)}
    assert {page for page in PAGES if page.is_relative_to(ROOT / "docs")} - {
        ROOT / "docs/README.md"
    } <= listed


NAMED = re.compile(r"`((?:expert|datasets|dlm|certmanip|tests|configs|examples)/[\w/.-]+)(?:::(\w+))?`")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_and_tests_that_a_page_names_exist(page: Path) -> None:
    for file, test in NAMED.findall(page.read_text()):
        assert (ROOT / file).exists() or (ROOT / f"{file}.py").exists(), file
        assert not test or test in definitions(file), f"{file}::{test}"


def test_every_key_of_the_files_is_described(monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs/files.md").read_text()
    described = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`\n]+)`", page))))
    accepted: set[str] = set()
    original = Section.__init__

    def record(section: Section, data: dict, name: str, keys: Sequence[str], *args: object) -> None:
        accepted.update(keys)
        original(section, data, name, keys, *args)

    monkeypatch.setattr(Section, "__init__", record)
    for path in sorted((ROOT / "configs/problem").rglob("*.yaml")):
        read_problem(path)
    assert {"vertices", "cone_fraction", "grippers", "half_ranges"} <= accepted
    assert accepted | {key for kind in FORMATS.values() for key in kind.ANSWER_KEYS} <= described


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_snippets_are_python_and_import_what_exists(page: Path) -> None:
    for snippet in re.findall(r"^```python\n(.*?)^```", page.read_text(), flags=re.MULTILINE | re.DOTALL):
        tree = ast.parse(snippet)
        imports: list[ast.stmt] = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
        names: dict[str, object] = {}
        exec(compile(ast.Module(imports, []), str(page), "exec"), names)
        calls = [
            n.func.id for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)
        ]
        assert [name for name in calls if not callable(names.get(name, print))] == []


def test_pages_that_the_code_names_exist() -> None:
    sources = [
        *(
            path
            for room in ("expert", "datasets", "dlm", "certmanip", "configs", "examples")
            for path in (ROOT / room).rglob("*.*")
        )
    ]
    texts = [path.read_text() for path in sources if path.suffix in (".py", ".yaml")]
    named = {page for text in texts for page in re.findall(r"\bdocs/[\w/-]+\.md", text)}
    assert "docs/errata.md" in named
    assert [page for page in sorted(named) if not (ROOT / page).exists()] == []

from pathlib import Path

from datasets.card import card, field_table
from datasets.fields import FIELDS
from datasets.store import read_dataset, read_manifest


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

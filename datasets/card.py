"""The card of a data set: what it holds, how it was made, what every field means."""

from collections.abc import Mapping
from typing import Any

from datasets.fields import AXES, FIELDS

TYPES = {"u": "uint8", "i": "int64", "f": "float64", "U": "text"}

CARD = """# {name}, seed {seed}

{tasks} manipulation tasks in the sagittal plane. Each one: a video of a polygonal object that is moved over a floor, the
expert's plan for {fingers} point fingers that move it so, and the mechanical parameters that connect the two.

Made by `python -m datasets.generate` with the settings and versions in `manifest.json`.
Objects have {facets[0]} to {facets[1]} facets and diameters of {diameter[0]} to {diameter[1]} m; mass {mass} kg, friction {friction}.

{draws} tasks were drawn. Left out: {failures}. Every draw that was left out is listed under `failed_draws`.
Plans: {statuses}; {least_push_kept} of {tasks} keep the least push of {least_push} m g while they touch, the others have none.
Each plan was found sound by the independent checker.

```python
from datasets.store import read_dataset
data = read_dataset("path/to/this/folder")   # checks sums, shapes, finite numbers
data.arrays["video"].shape, data[0].task, data[0].plan, data[0].parameters
```

SI units, angles in rad, counter-clockwise, y up, floor at y = 0; steps, fingers, facets count from 0. The body frame has its
origin in the centre of mass and is parallel to the world's at step 0; vertex 0 is the left end of the side at rest.
The camera looks at {size} x {size} pixels of {scale} m; x = {centre} lies in the middle, y = 0 is {below} m above the lower edge.

{fields}
"""


def card(manifest: Mapping[str, Any]) -> str:
    """Markdown, from a finished data set's manifest."""
    settings = manifest["settings"]
    failures = ", ".join(f"{n} {reason}" for reason, n in manifest["failures"].items())
    facts = {
        **manifest,
        **settings["shapes"],
        **settings["tasks"],
        **settings["camera"],
        "failures": failures or "none",
        "statuses": ", ".join(f"{n} {status}" for status, n in manifest["statuses"].items()),
        "tasks": manifest["tasks"],
        "fields": field_table(),
    }
    return CARD.format_map(facts)


def field_table() -> str:
    """Every field with type, axes and meaning."""
    axes = ", ".join(f"{letter} {meaning}" for letter, meaning in AXES.items())
    rows = [
        f"| `{name}` | {TYPES[f.kind]} | {' '.join(f.axes)} | {f.meaning} |" for name, f in FIELDS.items()
    ]
    return "\n".join([f"Axes: {axes}.", "", "| field | type | axes | meaning |", "|---|---|---|---|", *rows])

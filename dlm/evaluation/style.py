"""How the report looks: light or dark as the reader's system is, from a telephone's width to a desk's."""

STYLE = """
:root {
  color-scheme: light dark;
  --text: #1f2328; --soft: #59636e; --page: #ffffff; --card: #f6f8fa; --line: #d1d9e0; --accent: #0b62c4;
  --good: #d9f2df; --bad: #fbe3e0; --object: #f2c14e; --edge: #222; --goal: #7b8590; --floor: #59636e;
}
@media (prefers-color-scheme: dark) {
  :root {
    --text: #e6edf3; --soft: #9aa5b1; --page: #0e1319; --card: #171d25; --line: #323b46; --accent: #6cb2ff;
    --good: #153a22; --bad: #4a1f1d; --object: #b98a1d; --edge: #e6edf3; --goal: #9aa5b1; --floor: #7b8590;
  }
}
* { box-sizing: border-box; }
body { font: 16px/1.55 system-ui, sans-serif; margin: 0 auto; max-width: 1180px; padding: 1.5rem 1rem 4rem; color: var(--text); background: var(--page); }
h1 { font-size: 1.9rem; line-height: 1.2; margin: .5rem 0; }
h2 { font-size: 1.3rem; margin: 2.6rem 0 .6rem; padding-top: .8rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.6rem 0 .5rem; }
p, figcaption, .note { max-width: 46rem; } figcaption, .note { color: var(--soft); font-size: .9rem; }
a { color: var(--accent); } code { font-size: .9em; }
nav { display: flex; flex-wrap: wrap; gap: .3rem 1.1rem; font-size: .92rem; }
.scroll { overflow-x: auto; margin: .5rem 0 1rem; border: 1px solid var(--line); border-radius: 8px; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .88rem; min-width: 100%; }
th, td { padding: .35rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
tbody tr:last-child td { border-bottom: 0; } tbody tr:hover td { background: var(--card); }
thead th { background: var(--card); font-weight: 600; }
th:first-child, td:first-child { text-align: left; position: sticky; left: 0; background: var(--page); font-weight: 600; }
thead th:first-child { background: var(--card); }
td.good { background: var(--good); } td.bad { background: var(--bad); }
.words td { text-align: left; white-space: normal; vertical-align: top; } .words th { text-align: left; }
.origin td { overflow-wrap: anywhere; } .origin td:first-child { white-space: nowrap; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 34rem), 1fr)); gap: 0 1.5rem; }
.pair > * { min-width: 0; } .pair th, .pair td { padding-inline: .42rem; }
figure { margin: 1rem 0; } img.chart { display: block; max-width: 100%; height: auto; background: #fff; border-radius: 8px; border: 1px solid var(--line); padding: 6px; }
.wide { overflow-x: auto; } .wide img.chart { min-width: 46rem; }
.films { display: grid; grid-template-columns: repeat(auto-fill, minmax(7.2rem, 1fr)); gap: .7rem; align-items: end; }
.films figure { margin: 0; padding: .4rem; background: var(--card); border-radius: 8px; border: 1px solid var(--line); height: 100%; display: flex; flex-direction: column; justify-content: flex-end; }
.films svg, .films img { width: 100%; height: auto; display: block; }
.films figcaption { text-align: center; font-size: .82rem; padding-top: .3rem; }
.video { image-rendering: pixelated; border-radius: 4px; }
details { margin: .6rem 0; } summary { cursor: pointer; font-weight: 600; }
.film-object { fill: var(--object); stroke: var(--edge); } .film-goal { fill: none; stroke: var(--goal); } .film-floor { fill: var(--floor); }
@media (max-width: 600px) { body { font-size: 15px; padding: .8rem .7rem 3rem; } th, td { padding: .3rem .5rem; } }
@media print { details > * { display: block; } h2 { break-after: avoid; } figure { break-inside: avoid; } }
"""

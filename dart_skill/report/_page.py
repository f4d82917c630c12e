"""One HTML page of a run that stands alone: text, tables, figures and replay in one file, which asks nobody for anything."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

import numpy as np

from dart_skill.report._pictures import Picture
from dart_skill.report._replay import Replay, make_replay
from dart_skill.report._run import Run, machine, result_of, versions
from dart_skill.session import ThrowResult
from dart_skill.skill.learn import component_ellipsoids
from dart_skill.view import ViewUnavailable

POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline' 'unsafe-eval' blob: data:; worker-src blob: data:;"
    " img-src data: blob:; font-src data:; connect-src data: blob:; frame-src blob: data:"
)
"""Nothing is fetched from anywhere (Content Security Policy, level 3); the replay within the page inherits it."""
STYLE = """
:root { color-scheme: light; }
body { margin: 0 auto; padding: 1.5rem 1.5rem 4rem; max-width: 64rem; background: #fff; color: #1b1b1b;
       font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0.5rem 0 0.2rem; }
h2 { font-size: 1.2rem; margin: 2.6rem 0 0.6rem; padding-top: 0.8rem; border-top: 1px solid #ddd; }
p { max-width: 48rem; margin: 0.4rem 0; }
.quiet { color: #555; font-size: 0.9rem; }
.numbers { display: flex; flex-wrap: wrap; gap: 0.8rem; margin: 1.2rem 0; }
.numbers div { border: 1px solid #ddd; border-left: 4px solid #0072b2; border-radius: 4px; padding: 0.5rem 0.9rem;
               min-width: 6rem; max-width: 12rem; }
.numbers b { display: block; font-size: 1.5rem; line-height: 1.3; font-weight: 600; }
.numbers span { color: #555; font-size: 0.85rem; }
figure { margin: 0; }
figure svg { display: block; width: 100%; height: auto; }
figcaption { color: #555; font-size: 0.9rem; max-width: 48rem; margin-top: 0.3rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.6rem; text-align: right; border-bottom: 1px solid #e6e6e6; white-space: nowrap; }
th { border-bottom: 2px solid #999; font-weight: 600; vertical-align: bottom; white-space: normal; }
td.text, th.text { text-align: left; white-space: normal; }
.facts th { text-align: left; border-bottom: 1px solid #e6e6e6; font-weight: 600; white-space: nowrap; vertical-align: top; }
.facts td { text-align: left; white-space: normal; }
.out { color: #b34700; font-weight: 600; }
iframe { width: 100%; height: 34rem; border: 1px solid #ccc; border-radius: 4px; background: #fff; }
details { margin: 0.5rem 0; }
summary { cursor: pointer; }
pre { background: #f6f6f6; border: 1px solid #e0e0e0; border-radius: 4px; padding: 0.7rem 1rem; overflow: auto; max-height: 28rem;
      font: 0.8rem/1.45 ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; }
@media print { iframe { display: none; } h2 { break-after: avoid; } figure { break-inside: avoid; } }
"""


def page_of(run: Run, drawn: Sequence[Picture]) -> str:
    """The page of a run with its pictures; the same for the same run, versions and machine."""
    replay, why = _replay(run)
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{_text(run.about.title)} - dart_skill</title><style>{STYLE}</style></head><body>",
            f"<h1>{_text(run.about.title)}</h1>",
            _numbers(run),
            _replay_section(run, replay, why),
            *(_figure(picture) for picture in drawn),
            _throws_section(run, replay if run.own else None),
            _demonstrations_section(run, replay if not run.own else None),
            _what_was_run(run),
            "</body></html>\n",
        ]
    )


# the head


def _numbers(run: Run) -> str:
    """The few numbers that matter, large."""
    inside, errors = sum(throw.in_basket for throw in run.results), _errors(run.results)
    shown = [(f"{len(run.shown)}", "demonstrations")]
    if run.results:
        shown.append((f"{inside}/{len(run.results)}", "own throws in the basket"))
    if len(errors):
        low, middle, high = np.percentile(errors, [25, 50, 75])
        shown.append((f"{middle:.1f} cm", f"median landing error, quartiles {low:.1f} and {high:.1f}, n&nbsp;=&nbsp;{len(errors)}"))
        shown.append((f"{errors.max():.1f} cm", "largest landing error"))
    if "Seed" in run.about.facts:
        shown.append((_text(run.about.facts["Seed"]), "seed"))
    return '<div class="numbers">' + "".join(f"<div><b>{number}</b><span>{what}</span></div>" for number, what in shown) + "</div>"


def _errors(throws: Iterable[ThrowResult]) -> np.ndarray:
    return 100.0 * np.array([throw.error_m for throw in throws if throw.seen])


# the replay


def _replay(run: Run) -> tuple[Replay | None, str]:
    """The replay, or why there is none."""
    throws = run.own or run.guided
    if not any(throw.demonstration is not None for throw in throws):
        return None, "The bag holds no throw that can be shown."
    task = next(throw.demonstration.target for throw in throws if throw.demonstration is not None)
    gaussians = component_ellipsoids(run.skill.mixture(task)) if run.skill else ()
    guided = {k: throw.demonstration.id for k, throw in enumerate(run.guided) if throw.demonstration is not None}
    names = {k: f"throw {number}" for k, number in run.numbers.items()} if run.own else guided
    try:
        return make_replay(run.recording, throws, run.shown, gaussians, names), ""
    except ViewUnavailable:
        return None, "The replay needs the package viser, which was not there: pip install 'viser>=1.1,<1.2', then dart-skill report BAG."


def _replay_section(run: Run, replay: Replay | None, why: str) -> str:
    if replay is None:
        return f'<h2>Replay</h2><p class="quiet">{_text(why)}</p>'
    kind, throws = ("throws of the arm", run.own) if run.own else ("guided throws", run.guided)
    some = f"The first {len(replay.starts)} of {len(throws)}" if len(replay.starts) < len(throws) else f"All {len(throws)}"
    return (
        f"<h2>Replay</h2><p>{some} {kind}, {replay.seconds:.0f} s. Drag to turn, right button to move, wheel to come nearer; the bar below"
        " plays, stops and seeks. The tables say when each throw begins.</p>"
        f'<iframe title="Replay of the throws in three dimensions" loading="lazy" srcdoc="{html.escape(replay.html)}"></iframe>'
        '<p class="quiet">Arm as its joints were measured; ball (vermilion) and hand (axes, path in black) as the cameras saw them; basket'
        " (blue); ways of the hand in the demonstrations (grey); Gaussians of the skill for the first basket, two standard deviations"
        " (green).</p>"
    )


# figures and tables


def _figure(picture: Picture) -> str:
    caption = f"<figcaption>{_text(picture.caption)}</figcaption>"
    return f'<h2>{_text(picture.title)}</h2><figure id="{picture.name}">{picture.element}{caption}</figure>'


def _throws_section(run: Run, replay: Replay | None) -> str:
    begun = {number: f"{replay.starts[k]:.1f}" for k, number in run.numbers.items() if k in replay.starts} if replay else {}
    rows = [[str(number), *_result_cells(throw), begun.get(number, "")] for number, throw in enumerate(run.results, start=1)]
    table = _table([*_HEAD, "replay [s]"], rows, [_message(throw.message) for throw in run.results])
    return f"<h2>Throws of the arm</h2>{table if rows else _none('The arm made no throws of its own.')}"


def _demonstrations_section(run: Run, replay: Replay | None) -> str:
    rows, notes = [], []
    for number, throw in enumerate(run.guided):
        if throw.demonstration is None:
            continue
        start = f"{replay.starts[number]:.1f}" if replay and number in replay.starts else ""
        rows.append([_text(throw.demonstration.id), *_result_cells(result_of(throw)), start])
        notes.append(_message(throw.reason or ("" if throw.shows else "a miss: no demonstration")))
    if rows:
        return f"<h2>Guided throws</h2>{_table([*_HEAD, 'replay [s]'], rows, notes)}"
    rows = [[_text(one.id), *_target_cells(one.target.tolist())] for one in run.shown]
    table = _table(_HEAD[:6], rows, [""] * len(rows)) if rows else _none("There are none in this bag.")
    return f"<h2>Demonstrations</h2>{table}"


_HEAD = ["", "target x [m]", "y [m]", "z [m]", "distance [m]", "azimuth [°]", "landing x [m]", "y [m]", "error [cm]", "result"]


def _target_cells(target: Sequence[float]) -> list[str]:
    x, y, z = target
    cells = [f"{x:.3f}", f"{y:.3f}", f"{z:.3f}", f"{np.hypot(x, y):.2f}", f"{np.degrees(np.arctan2(y, x)):+.1f}"]
    return [_minus(cell) for cell in cells]


def _result_cells(throw: ThrowResult) -> list[str]:
    landing = [_minus(f"{value:.3f}") for value in throw.landing[:2]] if throw.landing is not None else ["not seen", "-"]
    error = "-" if throw.error_m is None else f"{100 * throw.error_m:.1f}"
    return [*_target_cells(throw.target), *landing, error, "in" if throw.in_basket else '<span class="out">out</span>']


def _minus(number: str) -> str:
    return number.replace("-", "\N{MINUS SIGN}")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str]) -> str:
    """Cells are HTML already; empty columns are left out."""
    rows, head = [[*row, note] for row, note in zip(rows, notes, strict=True)], [*head, "message"]
    kept = [k for k in range(len(head)) if k == 0 or any(row[k] for row in rows)]
    kinds = {0: ' class="text"', len(head) - 1: ' class="text"'}
    lines = ["".join(f"<th{kinds.get(k, '')}>{head[k]}</th>" for k in kept)]
    lines += ["".join(f"<td{kinds.get(k, '')}>{row[k]}</td>" for k in kept) for row in rows]
    return '<div class="wide"><table>' + "\n".join(f"<tr>{line}</tr>" for line in lines) + "</table></div>"


def _message(text: str) -> str:
    return _text(" ".join(text.split()))


def _none(text: str) -> str:
    return f'<p class="quiet">{text}</p>'


# what was run


def _what_was_run(run: Run) -> str:
    facts = {**run.about.facts, **_skill_facts(run)}
    facts |= {"Versions": ", ".join(f"{name} {version}" for name, version in versions().items()), "Machine": machine()}
    changed = "; ".join(f"--{name} {value} (default {default})" for name, value, default in run.about.changed)
    if run.about.options:
        facts = {"Options": changed or "all as they are by default", **facts}
    rows = "".join(f"<tr><th>{_text(name)}</th><td>{_text(value)}</td></tr>" for name, value in facts.items())
    files = "".join(f"<p><b>{_text(name)}</b></p><pre>{_text(text)}</pre>" for name, text in sorted(run.about.parameters.items()))
    count = len(run.about.parameters)
    folded = f"<details><summary>Parameters of the nodes: {count} files</summary>{files}</details>" if files else ""
    notes = "".join(f"<li>{_text(note)}</li>" for note in run.notes)
    remarks = f"<details><summary>Remarks on the recording: {len(run.notes)}</summary><ul>{notes}</ul></details>" if notes else ""
    return (
        f'<h2>What was run</h2><div class="wide"><table class="facts">{rows}</table></div>{folded}{remarks}'
        '<p class="quiet">This page is made from the bag and asks nobody for anything. The same bag, versions and machine give the same'
        " bytes.</p>"
    )


def _skill_facts(run: Run) -> dict[str, str]:
    skill = run.skill
    if skill is None:
        return {}
    c, n = skill.configuration, len(skill.throws)
    text = f"configuration '{c.name}', {c.components} components, n = {n} demonstrations"
    return {"Skill": f"{text}, the hand opens {1e3 * skill.hand_delay:.0f} ms after it is told to; model {skill.model_id}"}


def _text(value: object) -> str:
    return html.escape(str(value))

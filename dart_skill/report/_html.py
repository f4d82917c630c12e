"""What pages of a report are made of: one HTML file that stands alone and fetches nothing."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Mapping, Sequence

from dart_skill.common import palette
from dart_skill.common.palette import Colour, hexadecimal, in_the_dark
from dart_skill.report._pictures import Picture
from dart_skill.report._run import About, machine, versions

POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline' 'unsafe-eval' blob:"
    " data:; worker-src blob: data:; img-src data: blob:; font-src data:; connect-src data: blob:;"
    " frame-src blob: data:"
)
"""Nothing is fetched from anywhere (Content Security Policy, level 3); the replay within the page
inherits it.
"""
HANDLING = (
    "With a mouse: drag to turn, right button to move, wheel to come nearer. On a touch screen:"
    " one finger turns, two move and come nearer. The bar below plays, stops and seeks."
)
"""How a replay is looked at."""
NARROW = "40rem"
"""A screen that is not wider gets figures whose panels stand one below the other."""
SHADOWS = (
    "linear-gradient(to right, var(--page) 40%, transparent) 0 0 / 2.5rem 100% no-repeat local,"
    " linear-gradient(to left, var(--page) 40%, transparent) 100% 0 / 2.5rem 100% no-repeat local,"
    " linear-gradient(to right, var(--shadow), transparent) 0 0 / 1rem 100% no-repeat scroll,"
    " linear-gradient(to left, var(--shadow), transparent) 100% 0 / 1rem 100% no-repeat scroll,"
    " var(--page)"
)
"""Background of a box that scrolls sideways: a shadow at each edge beyond which there is more."""
STYLE = (
    """
:root { color-scheme: light dark; --page: #fff; --ink: #1b1b1b; --quiet: #555; --line: #ddd; --strong: #999; --box: #f6f6f6;
        --shadow: #0004; --accent: ACCENT; --warning: #b34700; }
@media (prefers-color-scheme: dark) {
  :root { --page: DARK_PAGE; --ink: DARK_INK; --quiet: #a8adb3; --line: #3a3f45; --strong: #6b7178; --box: #202328; --shadow: #fff5;
          --accent: DARK; --warning: #ff9a52; }
}
body { margin: 0 auto; padding: 1.5rem 1.5rem 4rem; max-width: 64rem; background: var(--page); color: var(--ink);
       font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0.5rem 0 0.2rem; }
h2 { font-size: 1.2rem; margin: 2.6rem 0 0.6rem; padding-top: 0.8rem; border-top: 1px solid var(--line); }
p { max-width: 48rem; margin: 0.4rem 0; }
.quiet { color: var(--quiet); font-size: 0.9rem; }
.numbers { display: flex; flex-wrap: wrap; gap: 0.8rem; margin: 1.2rem 0; }
.numbers div { border: 1px solid var(--line); border-left: 4px solid var(--accent); border-radius: 4px; padding: 0.5rem 0.9rem;
               flex: 0 1 auto; min-width: 6rem; max-width: 12rem; box-sizing: border-box; }
.numbers b { display: block; font-size: 1.5rem; line-height: 1.3; font-weight: 600; }
.numbers span { color: var(--quiet); font-size: 0.85rem; }
figure { margin: 0; }
figure svg { display: block; width: 100%; height: auto; border-radius: 4px; }
figure svg text { fill: var(--c000000); }
figure .narrow { display: none; max-width: 30rem; }
figcaption { color: var(--quiet); font-size: 0.9rem; max-width: 48rem; margin-top: 0.3rem; }
.key { display: flex; flex-wrap: wrap; gap: 0.2rem 1.1rem; margin: 0.4rem 0; padding: 0; list-style: none; font-size: 0.9rem; }
.key i { display: inline-block; width: 0.8em; height: 0.8em; margin-right: 0.4em; border: 1px solid var(--strong); }
.wide, pre { overflow-x: auto; background: SHADOWS; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.6rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { border-bottom: 2px solid var(--strong); font-weight: 600; vertical-align: bottom; white-space: normal; }
td.text, th.text { text-align: left; white-space: normal; }
td.text:not(:first-child) { min-width: 14rem; }
.facts th { text-align: left; border-bottom: 1px solid var(--line); font-weight: 600; white-space: nowrap; vertical-align: top; }
.facts td { text-align: left; white-space: normal; overflow-wrap: anywhere; }
.out { color: var(--warning); font-weight: 600; }
iframe { display: block; width: 100%; height: min(34rem, 85vh); box-sizing: border-box; border: 1px solid var(--strong); border-radius: 4px;
         background: var(--page); }
details { margin: 0.5rem 0; }
summary { cursor: pointer; }
pre { --page: var(--box); border: 1px solid var(--line); border-radius: 4px; padding: 0.7rem 1rem; overflow-y: auto; max-height: 28rem;
      font: 0.8rem/1.45 ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; }
@media (max-width: NARROW) {
  body { padding: 1rem 1rem 3rem; }
  figure .broad { display: none; }
  figure .narrow { display: block; }
  iframe { height: 19rem; }
  .numbers div { flex: 1 1 40%; max-width: none; }
  .facts th, .facts td { display: block; border-bottom: 0; padding: 0.1rem 0; }
  .facts td { border-bottom: 1px solid var(--line); padding-bottom: 0.4rem; }
}
@media print { iframe { display: none; } h2 { break-after: avoid; } figure { break-inside: avoid; } }
""".replace("ACCENT", hexadecimal(palette.BLUE))
    .replace("DARK_PAGE", hexadecimal(palette.DARK_PAGE))
    .replace("DARK_INK", hexadecimal(palette.DARK_INK))
    .replace("SHADOWS", SHADOWS)
    .replace("DARK", hexadecimal(palette.SKY))
    .replace("NARROW", NARROW)
)


def page(title: str, sections: Iterable[str]) -> str:
    """A page with its sections."""
    sections = list(sections)
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escaped(title)} - dart_skill</title><style>{STYLE}{colours_of(sections)}</style>",
            "</head><body>",
            f"<h1>{escaped(title)}</h1>",
            *sections,
            "</body></html>\n",
        ]
    )


def colours_of(sections: Iterable[str]) -> str:
    """The colours that figures name, such as `var(--c0072b2)`, for light and dark."""
    names = {name for one in sections for name in re.findall(r"var\(--c([0-9a-f]{6})", one)}
    light = {name: bytes.fromhex(name) for name in sorted(names | {"000000"})}
    dark = {name: in_the_dark((red, green, blue)) for name, (red, green, blue) in light.items()}
    return (
        f":root {{ {_set_colours(light)} }}\n"
        f"@media (prefers-color-scheme: dark) {{ :root {{ {_set_colours(dark)} }} }}\n"
    )


def _set_colours(colours: Mapping[str, Iterable[int]]) -> str:
    return " ".join(f"--c{name}: #{bytes(colour).hex()};" for name, colour in colours.items())


def large(shown: Iterable[tuple[str, str]]) -> str:
    """The few numbers that matter, and what they are."""
    return (
        '<div class="numbers">'
        + "".join(f"<div><b>{number}</b><span>{what}</span></div>" for number, what in shown)
        + "</div>"
    )


def colour_key(things: Mapping[str, Colour]) -> str:
    """Which colour is what."""
    items = "".join(
        f'<li><i style="background: var(--c{hexadecimal(colour)[1:]})"></i>{escaped(name)}</li>'
        for name, colour in things.items()
    )
    return f'<ul class="key">{items}</ul>'


def embedded(title: str, page_of_its_own: str) -> str:
    """A page within the page."""
    return (
        f'<iframe title="{title}" loading="lazy" srcdoc="{html.escape(page_of_its_own)}"></iframe>'
    )


def what_was_run(about: About, of_the_skill: Mapping[str, str], notes: Sequence[str]) -> str:
    """Options, versions and machine, the parameters of the nodes, and remarks."""
    facts = {**about.facts, **of_the_skill}
    facts |= {
        "Versions": ", ".join(f"{name} {version}" for name, version in versions().items()),
        "Machine": machine(),
    }
    changed = "; ".join(
        f"--{name} {value} (default {default})" for name, value, default in about.changed
    )
    if about.options:
        facts = {"Options": changed or "all as they are by default", **facts}
    rows = "".join(
        f"<tr><th>{escaped(name)}</th><td>{escaped(value)}</td></tr>"
        for name, value in facts.items()
    )
    files = "".join(
        f"<p><b>{escaped(name)}</b></p><pre>{escaped(content)}</pre>"
        for name, content in sorted(about.parameters.items())
    )
    folded = (
        f"<details><summary>Parameters of the nodes: {len(about.parameters)}"
        f" files</summary>{files}</details>"
        if files
        else ""
    )
    listed = "".join(f"<li>{escaped(note)}</li>" for note in notes)
    remarks = (
        "<details><summary>Remarks on the recording:"
        f" {len(notes)}</summary><ul>{listed}</ul></details>"
        if listed
        else ""
    )
    return (
        '<h2>What was run</h2><div class="wide" tabindex="0"><table'
        f' class="facts">{rows}</table></div>{folded}{remarks}<p class="quiet">This page is made'
        " from the bag and loads nothing from elsewhere. The same bag, versions and machine give the"
        " same bytes.</p>"
    )


def figure(picture: Picture) -> str:
    """A picture with its title and caption."""
    caption = f"<figcaption>{escaped(picture.caption)}</figcaption>"
    return (
        f"<h2>{escaped(picture.title)}</h2><figure"
        f' id="{picture.name}">{picture.element}{caption}</figure>'
    )


TEXTS = ("situation", "message", "id")
"""Heads of columns that hold text."""


def table_of(head: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str]) -> str:
    """Cells are HTML already; empty columns are left out. Who cannot see the end of a row scrolls
    the table, also with the keyboard.
    """
    rows, head = [[*row, note] for row, note in zip(rows, notes, strict=True)], [*head, "message"]
    kept = [k for k in range(len(head)) if k == 0 or any(row[k] for row in rows)]
    kinds = {k: ' class="text"' for k, what in enumerate(head) if k == 0 or what in TEXTS}
    lines = ["".join(f"<th{kinds.get(k, '')}>{head[k]}</th>" for k in kept)]
    lines += ["".join(f"<td{kinds.get(k, '')}>{row[k]}</td>" for k in kept) for row in rows]
    return (
        '<div class="wide" tabindex="0"><table>'
        + "\n".join(f"<tr>{line}</tr>" for line in lines)
        + "</table></div>"
    )


def one_line(text: str) -> str:
    """A text in one line, escaped."""
    return escaped(" ".join(text.split()))


def quiet(text: str) -> str:
    """A sentence that says less than others; HTML already."""
    return f'<p class="quiet">{text}</p>'


def escaped(value: object) -> str:
    """A text or number as it can stand in HTML."""
    return html.escape(str(value))

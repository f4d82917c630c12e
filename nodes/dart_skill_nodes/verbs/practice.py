"""Practice over the real graph: a few demonstrations, then throw after throw, each of which the arm learns from."""

import argparse
import json
import sys
import time
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np

from dart_skill.experiments.practice import CHANGES
from dart_skill.experiments.summary import ThrowResult
from dart_skill.report import PAGE, write_page
from dart_skill.report.run import About
from dart_skill_nodes import conversions
from dart_skill_nodes.coaching import Coach
from dart_skill_nodes.command_lines import parser_of
from dart_skill_nodes.demo import asked, carried_out, parameter_texts, place, say, teach
from dart_skill_nodes.graph import LAYOUTS, NODES, Graph

BLOCK = 5
"""Throws per line of the table."""


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Command line of practice."""
    parser = parser_of("practice")
    options = parser.parse_args(arguments)
    options.asked = asked(parser, options)
    for name, least in (("seed", 0), ("demonstrations", 2), ("throws", 1), ("change_after", 0)):
        if getattr(options, name) < least:
            parser.error(f"--{name} is {getattr(options, name)}; it must be at least {least}")
    if options.change != "none" and options.change_after >= options.throws:
        parser.error(f"--change-after is {options.change_after}: there are {options.throws} throws only")
    options.output = (options.output or Path("output") / f"practice_{datetime.now():%Y_%m_%d-%H_%M_%S}").resolve()
    if (options.output / "bag").exists():
        parser.error(f"--output {options.output} holds a bag already: choose another folder")
    return options


def _report(feedback, before: int, messages: dict[int, str]) -> None:
    """One line per throw, and its message kept under its number; `before`: throws of earlier goals."""
    if feedback.phase != "done":
        return
    messages[before + feedback.number] = feedback.message
    outcome = feedback.outcome
    error = f"{100 * outcome.landing_error:.1f} cm" if outcome.landing_seen else "landing not seen"
    where = place(conversions.vector(outcome.target))
    say(f"throw {before + feedback.number}: {where}: {'in' if outcome.in_basket else 'out'}, {error} {feedback.message}")


def run(options: argparse.Namespace) -> dict:
    """The whole job on a graph of its own."""
    extra = {"skill_learner": {"practice_method": options.method}} if options.method else {}
    with Graph(options.output / "logs") as graph:
        say(f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])}")
        coach = Coach(graph.dead)
        coach.wait_until_gone(NODES)
        graph.start_all(options.layout, options.seed, options.output / "bag", extra)
        coach.wait_until_ready()
        teach(coach, options.seed, options.demonstrations)
        say(coach.learn().message)
        begun = time.monotonic()
        blocks = [options.throws] if options.change == "none" else [options.change_after, options.throws - options.change_after]
        results, messages = [], {}
        for block, throws in enumerate(blocks):
            if block:
                coach.set_parameters("/wam_simulator", CHANGES[options.change])
                say(f"from now on: {options.change}")
            if throws:
                before = sum(len(result.outcomes) for result in results)
                results.append(coach.practise(throws, on_feedback=partial(_report, before=before, messages=messages)))
        took = time.monotonic() - begun
        coach.close()
    outcomes = [outcome for result in results for outcome in result.outcomes]
    throws = [_as_row(outcome, messages.get(number, "")) for number, outcome in enumerate(outcomes, start=1)]
    return {
        "seed": options.seed, "demonstrations": options.demonstrations, "thrown": sum(result.thrown for result in results),
        "learned": sum(result.learned for result in results), "change": options.change, "change_after": options.change_after,
        "seconds": round(took, 1), "message": results[-1].message, "bag": str(options.output / "bag"), "throws": throws,
    }  # fmt: skip


def _as_row(outcome, message: str) -> dict:
    seen = bool(outcome.landing_seen)
    return {
        "target_m": conversions.vector(outcome.target).tolist(),
        "landing_m": conversions.vector(outcome.landing).tolist() if seen else None,
        "error_m": float(outcome.landing_error) if seen else None,
        "in_basket": bool(outcome.in_basket),
        "message": message,
    }


def table(summary: dict) -> str:
    """Errors in blocks of throws."""
    lines = [f"{'throws':>10}{'in':>8}{'median [cm]':>14}{'worst [cm]':>13}"]
    for first in range(0, len(summary["throws"]), BLOCK):
        block = summary["throws"][first : first + BLOCK]
        errors = 100 * np.array([row["error_m"] for row in block if row["error_m"] is not None])
        numbers = f"{np.median(errors):>14.1f}{errors.max():>13.1f}" if len(errors) else f"{'not seen':>14}"
        span, inside = f"{first + 1}-{first + len(block)}", sum(row["in_basket"] for row in block)
        lines.append(f"{span:>10}{f'{inside}/{len(block)}':>8}{numbers}")
    done = f"{summary['thrown']} throws made, {summary['learned']} learned from, in {summary['seconds']:.0f} s"
    return "\n".join([*lines, done])


def write_report(summary: dict, options: argparse.Namespace) -> None:
    """summary.json, and the page beside it."""
    (options.output / "summary.json").write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    changed = options.change != "none"
    facts = {
        "Seed": str(options.seed),
        "Change": f"{options.change}, after {options.change_after} own throws, unannounced" if changed else "none",
        "Learned from": f"{summary['learned']} of {summary['thrown']} own throws, besides {options.demonstrations} demonstrations",
        "Time": f"{summary['seconds']:.0f} s for the own throws",
    }
    marks = {options.change_after: options.change} if changed else {}
    title = f"Practice: {options.demonstrations} demonstrations, {summary['thrown']} own throws"
    names = ("target_m", "landing_m", "error_m", "in_basket", "message")
    results = [ThrowResult(*(row[name] for name in names)) for row in summary["throws"]]
    write_page(summary["bag"], options.output / PAGE, About(title, facts, options.asked, parameter_texts(), marks=marks), results)


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = parse(arguments)
    summary = carried_out(run, options, "practice")
    if summary is None:
        return 1
    print(json.dumps(summary, indent=1) if options.json else table(summary))
    try:
        write_report(summary, options)
    except (ValueError, OSError) as error:
        say(f"no report: {error}")
        return 1
    if not options.json:
        print(f"\nbag, summary.json and report.html: {options.output}")
        print(f"next: open {options.output / PAGE} in a browser, or dart-skill view {summary['bag']}")
    return 0 if summary["thrown"] == options.throws else 1


if __name__ == "__main__":
    sys.exit(main())

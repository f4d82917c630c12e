"""`dart-skill experiment soak`: practice for hours on the real graph; does it stay as it was?"""

import argparse
import json
import os
import time
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_arm, differences, folder, output_folder
from dart_skill.common.files import new_file
from dart_skill_nodes.comms.names import COMMANDS
from dart_skill_nodes.process.graph_processes import SIMULATED, Graph, GraphFailure
from dart_skill_nodes.verbs.on_graph import carried_out, say, started
from dart_skill_nodes.verbs.trials import teach

if TYPE_CHECKING:
    from dart_skill_nodes.client.graph_client import GraphClient
    from tests.benches.soak.samples import Sample, Usage

ROUND = 10
"""Throws between two samples."""
DEMONSTRATIONS = 3
FASTEST = 1000.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Practise on the real graph for hours. After every ten throws look at the memory, the"
        " threads and the open descriptors of its processes, and at the speed of its loop; at the"
        " end look for every throw in the bag."
    )
    parser.add_argument("--minutes", type=float, default=120.0, help="of practice (default 120)")
    parser.add_argument(
        "--warm-up", type=float, metavar="MINUTES", help="are not judged (default: a tenth of it)"
    )
    parser.add_argument(
        "--layout",
        choices=SIMULATED,
        default="composed",
        help="processes of the graph (default composed)",
    )
    parser.add_argument(
        "--speed",
        type=float,
        default=0.0,
        help="of the world, times real time (default: as fast as the machine can)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="everything random comes from it (default 0)"
    )
    parser.add_argument(
        "--output",
        type=folder,
        help="folder for bag, samples.json, curve and logs (default output/soak_<date>)",
    )
    add_arm(parser)
    parser.add_argument("--json", action="store_true", help="the samples as JSON on stdout")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run the soak; exit status 1 if something did not stay as it was."""
    from tests.benches.soak.samples import Sample, changes

    if not options.minutes > 0.0 or options.seed < 0 or not 0.0 <= options.speed <= FASTEST:
        parser.error(
            f"--minutes {options.minutes}, --seed {options.seed}, --speed {options.speed}: more"
            f" than 0, at least 0, 0 to {FASTEST}"
        )
    options.warm_up = 0.1 * options.minutes if options.warm_up is None else options.warm_up
    options.differs, options.output = (
        differences(parser, options),
        output_folder(parser, options.output),
    )
    samples: list[Sample] = []
    try:
        ended = carried_out(partial(run, samples=samples), options, "the soak")
    except KeyboardInterrupt:
        if not samples:
            raise
        ended = None
    if not samples:
        return 1
    wrong = [] if ended else ["it did not come to its end"]
    try:
        wrong += changes(samples, options.warm_up) + _missing(
            samples[-1].thrown, options.output / "bag"
        )
    except ValueError as error:
        wrong.append(str(error))
    told = {"samples": [asdict(one) for one in samples], "wrong": wrong}
    with new_file(options.output / "samples.json", replace=True) as file:
        file.write((json.dumps(told, indent=1) + "\n").encode())
    _draw(samples, options)
    print(
        json.dumps(told)
        if options.json
        else "\n".join([_told(samples[-1]), *(wrong or ["all stayed as it was"])])
    )
    return int(bool(wrong))


def run(options: argparse.Namespace, samples: list["Sample"]) -> bool:
    """The soak on a graph of its own. samples: gets each when it is taken, as a soak may be
    stopped.
    """

    with Graph(options.output / "logs") as graph:
        client = started(graph, options)
        teach(client, options.seed, DEMONSTRATIONS)
        say(client.learn().message)
        client.set_parameters("wam_simulator", {"speed_factor": options.speed})
        for sample in practise(
            client,
            {name: process.pid for name, process in graph.processes.items()},
            options.minutes,
        ):
            samples.append(sample)
            say(_told(sample))
        client.close()
    return True


def practise(
    client: "GraphClient", processes: dict[str, int], minutes: float
) -> Iterator["Sample"]:
    """Rounds of throws for so long [min], and a sample after each but the first, which says when
    the world's time was what.

    processes: numbers of those that are looked at, by name.
    """
    from tests.benches.soak.samples import Sample

    now = begun = time.monotonic()
    thrown, before, stamp, used = 0, 0.0, 0.0, dict.fromkeys(processes, 0.0)
    while not before or now - begun < 60.0 * minutes:
        asked = time.monotonic()
        result = client.practise(ROUND)
        now, before, stamp = time.monotonic(), stamp, _stamp(result)
        already, used = used, {name: _processor_time_of(pid) for name, pid in processes.items()}
        thrown += result.executed
        if before:
            usage = {
                name: _usage(pid, (used[name] - already[name]) / (stamp - before))
                for name, pid in processes.items()
            }
            yield Sample((now - begun) / 60.0, thrown, (stamp - before) / (now - asked), usage)


def _stamp(result) -> float:
    """Stamp of the last throw of a round [s]; GraphFailure if the graph makes none any more."""
    from dart_skill_nodes.comms import conversions

    if not result.success:
        raise GraphFailure(result.message)
    return conversions.stamp_ns(result.outcomes[-1].header.stamp) * 1e-9


def _usage(pid: int, processor: float) -> "Usage":
    from tests.benches.soak.samples import Usage

    process = Path(f"/proc/{pid}")
    pages = int((process / "statm").read_text().split()[1])
    memory = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
    threads, descriptors = (len(os.listdir(process / name)) for name in ("task", "fd"))
    return Usage(memory, processor, threads, descriptors)


def _processor_time_of(pid: int) -> float:
    """Processor time that a process has used so far, its threads together [s]."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def _missing(thrown: int, bag: Path) -> list[str]:
    """Throws that are not in the bag, in words: lessons open the hand, too."""
    from dart_skill.recording import GraphBag, GripSignal

    grip = GripSignal()
    with GraphBag(bag) as reader:
        for message in reader.messages([f"/{COMMANDS}"], decode=False):
            grip.take_command(message.data)
    found = len(grip.openings)
    return (
        [f"the hand opened {found} times in the bag, for {thrown} throws"]
        if found < thrown
        else []
    )


def _draw(samples: list["Sample"], options: argparse.Namespace) -> None:
    from dart_skill.figures import save
    from tests.benches.soak.samples import curve

    save(curve(samples, options.warm_up), options.output, "soak")


def _told(last: "Sample") -> str:
    memory = ", ".join(f"{name} {one.memory:.0f} MB" for name, one in last.usage.items())
    return (
        f"{last.minutes:6.1f} min: {last.thrown} throws, {last.speed:.2f} times real time;"
        f" {memory}"
    )

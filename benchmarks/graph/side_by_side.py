#!/usr/bin/env python3
"""Graphs side by side on one machine: 1 to 20 of them, each on a ROS domain of its own, throw at
the same time.

    source tools/env.sh && python3 -m benchmarks.graph.side_by_side --graphs 1 2 4 8 12 20

Each graph is the default layout of `dart-skill up`: nodes in one process, the learner in another,
a bag that is written. All have the same seed, learn from bags/demonstrations and throw at the same
baskets, so all must have the same outcomes, to the last bit. They begin when the last one is
ready. `sum` are seconds of all worlds in a second of the clock, while throws last from their plan
to their outcome. A step is 2 ms of a world; its processor time is that of both processes, with
resets, plans, judging and the bag. Memory is the proportional set size of both processes: what
several share counts in parts.
"""

import argparse
import json
import os
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

BAG = Path(__file__).parents[2] / "bags" / "demonstrations"
TARGETS = ((1.9, 0.2, 0.4), (1.6, -0.5, 0.4), (2.1, 0.4, 0.4))
"""Baskets, which take turns [m]."""


def processor_time(pids: list[int]) -> float:
    """Of processes so far, all threads [s]."""
    fields = [Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split() for pid in pids]
    return sum(int(one[11]) + int(one[12]) for one in fields) / os.sysconf("SC_CLK_TCK")


def memory(pids: list[int]) -> int:
    """Proportional set size of processes [bytes]."""
    lines = [
        line for pid in pids for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    ]
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def throw(throws: int, seed: int) -> None:
    """One graph: says when it is ready, waits for a line, throws, and says what came of it."""
    from dart_skill_nodes.process.environment import choose_domain

    choose_domain()
    import numpy as np
    import rclpy

    from dart_skill_nodes.client.graph_client import GraphClient
    from dart_skill_nodes.process.graph_processes import Graph

    rclpy.init()
    with tempfile.TemporaryDirectory() as folder, Graph(Path(folder) / "logs") as graph:
        client = GraphClient(graph.dead, appears=600.0)
        graph.start_all("composed", seed, Path(folder) / "bag")
        client.wait_until_ready(600.0)
        model = client.learn(bag=str(BAG), at_least=13).model_id
        pids = [process.pid for process in graph.processes.values()]

        def steps() -> int:
            asked = time.monotonic()
            while client.counted_at <= asked:
                client.spin()
            return client.simulated_steps

        before = steps()
        print("ready", flush=True)
        sys.stdin.readline()
        begun, used = time.monotonic(), processor_time(pids)
        results = [client.throw(np.array(TARGETS[k % len(TARGETS)])) for k in range(throws)]
        ended, used, after, size = (
            time.monotonic(),
            processor_time(pids) - used,
            steps(),
            memory(pids),
        )
        client.close()
    errors = [struct.pack("<d", one.outcome.error).hex() for one in results]
    said = [one.message or one.outcome.message for one in results]
    seconds = float(client.throw_seconds[0])
    result = {
        "model": model,
        "errors": errors,
        "in": sum(one.outcome.success for one in results),
        "said": said,
    }
    costs = {
        "begun": begun,
        "ended": ended,
        "used": used,
        "steps": after - before,
        "seconds": seconds,
        "size": size,
    }
    print(json.dumps({"result": result, **costs}))
    rclpy.try_shutdown()


def measure(graphs: int, throws: int, seed: int) -> dict[str, Any]:
    """So many graphs at once; the script ends if one fails, or if their results differ."""
    command = [sys.executable, __file__, "--one", "--throws", str(throws), "--seed", str(seed)]
    environment = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
    streams: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    running = [subprocess.Popen(command, env=environment, **streams) for _ in range(graphs)]
    try:
        begun = time.monotonic()
        for one in running:
            if one.stdout.readline() != "ready\n":
                sys.exit(f"one of {graphs} graphs did not start: see its error above")
        start = time.monotonic() - begun
        for one in running:
            one.stdin.write("\n")
            one.stdin.flush()
        told = [json.loads(one.communicate()[0] or "null") for one in running]
    finally:
        for one in running:
            if one.poll() is None:
                one.terminate()
    if None in told:
        sys.exit(f"{told.count(None)} of {graphs} graphs failed: see their errors above")
    results = {json.dumps(one["result"]) for one in told}
    if len(results) > 1:
        sys.exit(
            f"the results of {graphs} graphs with seed {seed} differ:\n"
            + "\n".join(sorted(results))
        )
    lasted = max(one["ended"] for one in told) - min(one["begun"] for one in told)
    return {
        "graphs": graphs,
        "start": start,
        "sum": sum(one["seconds"] for one in told) / lasted,
        "step": sum(one["used"] for one in told) / sum(one["steps"] for one in told),
        "memory": sum(one["size"] for one in told) / graphs,
        "result": told[0]["result"],
    }


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--graphs",
        type=int,
        nargs="+",
        default=[1, 2, 4, 8],
        metavar="N",
        help="at once (default 1 2 4 8)",
    )
    parser.add_argument("--throws", type=int, default=6, help="of each graph (default 6)")
    parser.add_argument("--seed", type=int, default=0, help="of every graph (default 0)")
    parser.add_argument(
        "--results", type=Path, metavar="FILE", help="write the numbers there, as JSON"
    )
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        return throw(options.throws, options.seed)
    found: list[dict[str, Any]] = []
    print(
        f"{len(os.sched_getaffinity(0))} cores, {options.throws} throws of each graph", flush=True
    )
    print(
        f"{'graphs':>6}{'ready after':>13}{'sum':>14}{'a step':>11}{'memory of each':>16}{'in':>7}",
        flush=True,
    )
    for graphs in options.graphs:
        one = measure(graphs, options.throws, options.seed)
        found.append(one)
        if one["result"] != found[0]["result"]:
            sys.exit(
                f"{graphs} graphs had another result than {found[0]['graphs']}: {one['result']},"
                f" {found[0]['result']}"
            )
        costs = (
            f"{one['start']:11.1f} s{one['sum']:10.1f} s/s{1e3 * one['step']:8.2f}"
            f" ms{1e-6 * one['memory']:13.0f} MB"
        )
        print(f"{graphs:>6}{costs}{one['result']['in']:>4} of {options.throws}", flush=True)
        if options.results:
            options.results.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""The one table of `make benchmark`: what each script measured beside a peer, a floor or a limit.

    python3 -m benchmarks.rows build/benchmark.jsonl

A script tells its rows as it measures them. They are kept where the variable BENCHMARK_ROWS names
a file.
"""

import json
import os
import sys
from pathlib import Path

FILE = "BENCHMARK_ROWS"


def tell(
    work: str,
    ours: str,
    beside: str = "",
    ratio: float | None = None,
    asked: str = "",
    met: bool | None = None,
) -> None:
    """Keep a row of the table.

    * work: what was done.
    * ours, beside: what it took us, and the peer or floor with its name, with units.
    * ratio: how many times as fast as that we are.
    * asked: the goal, in words or as a ratio; met: whether it was reached, None where nothing is
      asked.
    """
    if name := os.environ.get(FILE):
        row = {
            "work": work,
            "ours": ours,
            "beside": beside,
            "ratio": None if ratio is None else round(ratio, 2),
            "asked": asked,
            "met": met,
        }
        with Path(name).open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def table(rows: list[dict]) -> str:
    """All rows below each other, in columns."""
    cells = [["work", "ours", "beside", "ratio", "asked", ""]]
    for row in rows:
        ratio, verdict = (
            "" if row["ratio"] is None else f"{row['ratio']:g}",
            {None: "", True: "reached", False: "missed"}[row["met"]],
        )
        cells.append([row["work"], row["ours"], row["beside"], ratio, row["asked"], verdict])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in cells
    )


def main() -> None:
    """Entry point."""
    rows = [
        json.loads(line) for line in Path(sys.argv[1]).read_text(encoding="utf-8").splitlines()
    ]
    print(table(rows))
    wanted = [row for row in rows if row["met"] is not None]
    print(f"{sum(row['met'] for row in wanted)} of {len(wanted)} goals reached")


if __name__ == "__main__":
    main()

"""Where the repository's files are, for tests in whatever folder."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BAGS, DOCS, CONFIG = ROOT / "bags", ROOT / "docs", ROOT / "config"

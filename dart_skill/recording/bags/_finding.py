"""What a check of a bag has to say."""

from __future__ import annotations

from dataclasses import dataclass

RECOVER = "make a new bag of what is in it: dart-skill bag recover"
REWRITE = "write its index anew: dart-skill bag recover"
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """Something about a bag.

    Parameters
    ----------
    severity
        "error" (something is lost or unreadable), "warning" (look at it) or "note".
    place
        File, topic or byte.
    remedy
        What to do about it; empty if nothing needs to be done.
    message
        What it is.
    """

    severity: str
    place: str
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.place}: {self.message}" + (
            f" ({self.remedy})" if self.remedy else ""
        )

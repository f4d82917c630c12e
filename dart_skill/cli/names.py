"""Names that the command line offers: for help and completion with TAB, which must not import what
they belong to.

Each is defined where its meaning is; a test compares. Names of professionals:
`dart_skill.darts.PROFESSIONALS`.
"""

CONFIGURATIONS = (
    "default", "intervals", "thesis", "thesis_local", "em", "weighted", "cross_validated", "autonomous", "shown_release", "two_frames",
)  # fmt: skip
"""`dart_skill.skills.protocol._throw_settings`."""
PRACTICE_METHODS = ("residual", "newton", "bootstrap", "both", "power", "none")
"""`dart_skill.skills.protocol._throw_settings`."""
CHANGES = ("none", "heavier_ball", "friction", "weaker_motors", "slower_hand", "base_turned")
"""`dart_skill.experiments.studies.practice`."""
SEARCHES = (
    "mixture", "mixture_daspec", "mixture_automatic", "mixture_automatic_free", "mixture_tenth", "mixture_automatic_tenth",
    "mixture_tenfold", "mixture_automatic_tenfold", "power", "power_constant", "power_proportional", "cem", "cma", "cma_default",
    "reinforce", "enac", "restarts", "monte_carlo", "niches", "sharpening", "model_based",
)  # fmt: skip
"""`dart_skill.experiments.studies.dart_search`."""
SCHEDULES = ("thesis", "extended", "thesis_12000", "extended_12000")
"""`dart_skill.experiments.studies.dart_search`."""
LANDSCAPES = ("moving_peaks_2", "moving_peaks_5", "vanishing_peak", "half_range", "stuck_joint")
"""`dart_skill.experiments.studies.landscapes`."""
FIGURES = (
    "3.1", "3.2", "5.1", "5.2", "5.3", "5.4", "5.5", "6.1", "6.2", "6.3", "6.4", "6.5", "6.6", "7.1", "7.4", "8.1", "8.2", "8.3", "8.4.4",
    "8.6", "8.7", "8.8", "8.9", "8.10", "8.11", "correction", "landscape", "place_strip", "regrets",
)  # fmt: skip
"""`dart_skill.experiments.thesis`."""

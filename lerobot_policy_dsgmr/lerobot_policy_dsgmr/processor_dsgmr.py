"""What lerobot does before and after the policy: the default steps, which scale nothing here."""

from typing import Any

from lerobot.processor import make_default_pre_post_processors

from lerobot_policy_dsgmr.configuration_dsgmr import DSGMRConfig


def make_dsgmr_pre_post_processors(
    config: DSGMRConfig, dataset_stats: dict[str, dict[str, Any]] | None = None
) -> tuple[Any, Any]:
    """The pipelines before and after the policy, under the name by which lerobot looks for it."""
    return make_default_pre_post_processors(config, dataset_stats, normalizer_device=config.device)

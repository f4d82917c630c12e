"""Settings of the policy `dsgmr`, which lerobot registers, saves and reads."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import NormalizationMode, PreTrainedConfig
from lerobot.optim import OptimizerConfig, SGDConfig

from lerobot_policy_dsgmr.task_model import MODELS, LearnerSettings, names_of

STATE, ENVIRONMENT, ACTION = "observation.state", "observation.environment_state", "action"


@PreTrainedConfig.register_subclass("dsgmr")
@dataclass
class DSGMRConfig(PreTrainedConfig):
    """Settings of `DSGMRPolicy`. Names and frames per second are those of the dataset.

    Parameters
    ----------
    device
        Default cpu: the learning is numpy's.
    push_to_hub
        Default False: nothing leaves the machine unless it is asked for.
    model
        "dsgmr" (default), a mixture that draws a spring and damper, or "per_step", a Gaussian at
        each step of time.
    n_components
        Of "dsgmr".
    stiffness
        Of the spring of "dsgmr" per unit mass [1/s^2].
    n_steps
        Of "per_step", and of elements that are no coordinates.
    covariance_prior
        So many demonstrations it takes to believe that one direction varies less than another; not
        for a pose that "dsgmr" learns.
    frames
        Task frames of a pose (`task_model.frames_of`): "start", "world", the name of a body,
        "azimuth:BODY", "target:BODY". Default, none: "start" and every body that is seen.
    held
        Body that the hand holds. The frame of another body is then where the hand would be if the
        held one were there.
    """

    device: str | None = "cpu"
    push_to_hub: bool = False
    model: str = "dsgmr"
    n_components: int = 20
    stiffness: float = 400.0
    n_steps: int = 200
    covariance_prior: float = 2.0
    frames: list[str] = field(default_factory=list)
    held: str = ""
    fps: float = 0.0
    state_names: list[str] = field(default_factory=list)
    environment_names: list[str] = field(default_factory=list)
    action_names: list[str] = field(default_factory=list)
    # rotations and quaternions must not be scaled axis by axis
    normalization_mapping: dict[str, NormalizationMode] = field(
        default_factory=lambda: dict.fromkeys(
            ("STATE", "ENV", "ACTION", "VISUAL"), NormalizationMode.IDENTITY
        )
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.model not in MODELS:
            raise ValueError(f"model is '{self.model}': give {' or '.join(MODELS)}")

    def take_names(self, features: Mapping[str, Mapping[str, Any]], fps: float) -> None:
        """What the dataset calls its elements, and its frames per second [1/s]."""
        self.fps = float(fps)
        self.state_names = names_of(features, STATE)
        self.environment_names = names_of(features, ENVIRONMENT)
        self.action_names = names_of(features, ACTION)

    @property
    def learner(self) -> LearnerSettings:
        """What `task_model` takes from here."""
        return LearnerSettings(
            **{name: getattr(self, name) for name in LearnerSettings.__dataclass_fields__}
        )

    @property
    def observation_delta_indices(self) -> None:
        return None

    @property
    def action_delta_indices(self) -> None:
        return None

    @property
    def reward_delta_indices(self) -> None:
        return None

    def get_optimizer_preset(self) -> OptimizerConfig:
        """One that changes nothing: nothing is learned by gradients."""
        return SGDConfig(lr=0.0)

    def get_scheduler_preset(self) -> None:
        return None

    def validate_features(self) -> None:
        """ValueError for a dataset without state or action; pictures are left alone."""
        if self.robot_state_feature is None or self.action_feature is None:
            raise ValueError(f"dsgmr needs the features '{STATE}' and '{ACTION}'")

"""The policy: between lerobot's tensors and `task_model`.

Nothing is learned by gradients. The training loop of lerobot hands over shuffled frames; `forward`
keeps them, and `update`, which the loop calls after each step, fits the model in closed form (or by
EM) once all frames of all episodes that were met are there: after one epoch, that is
ceil(frames / batch size) steps. So it learns from what the loop was told to train on, held-out
episodes and `--dataset.episodes` included. More steps change nothing, nor does a model that was
loaded. The one parameter is there for the optimizer: its gradient is zero.

What was fitted is one buffer of bytes, so that a checkpoint holds it to the last bit on every
device.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.policies.pretrained import PreTrainedPolicy
from torch import Tensor, nn

from lerobot_policy_dsgmr.configuration_dsgmr import ACTION, ENVIRONMENT, STATE, DSGMRConfig
from lerobot_policy_dsgmr.task_model import Episode, TaskModel

LEARNED = "learned"
"""Name of the buffer."""


class DSGMRPolicy(PreTrainedPolicy):
    """A policy that plans a movement from the first observation of an episode, and plays it.

    Parameters
    ----------
    config
        Its settings.
    dataset_stats
        Not used: nothing is scaled.
    dataset_meta
        Of the dataset to learn from; None for a policy that is loaded.
    """

    config_class = DSGMRConfig
    name = "dsgmr"

    def __init__(
        self,
        config: DSGMRConfig,
        dataset_stats: dict[str, Any] | None = None,
        dataset_meta: Any = None,
        **others: Any,
    ) -> None:
        super().__init__(config)
        config.validate_features()
        self._bounds: dict[int, tuple[int, int]] = {}
        if dataset_meta is not None:
            told = dataset_meta.episodes
            bounds = zip(told["dataset_from_index"], told["dataset_to_index"], strict=True)
            self._bounds = dict(zip(told["episode_index"], bounds, strict=True))
            if not config.action_names:
                config.take_names(dataset_meta.features, dataset_meta.fps)
        self.without_gradient = nn.Parameter(torch.zeros(()))
        self.register_buffer(LEARNED, torch.zeros(0, dtype=torch.uint8))
        self.register_load_state_dict_pre_hook(_make_room)
        self._seen: dict[int, dict[int, tuple[np.ndarray, ...]]] = {}
        self._n_fitted = 0
        self._model: TaskModel | None = None
        self._expected: dict[int, np.ndarray] = {}
        self.reset()

    def get_optim_params(self) -> list[nn.Parameter]:
        """The one parameter, which stays what it is."""
        return [self.without_gradient]

    def reset(self) -> None:
        """Forget the plan: the next observation is the first one of an episode."""
        self._plan: Tensor | None = None
        self._next = 0

    @property
    def model(self) -> TaskModel | None:
        """What was learned; None before."""
        learned = self.get_buffer(LEARNED)
        if self._model is None and learned.numel():
            content = learned.cpu().numpy().tobytes()
            self._model = TaskModel.from_bytes(self.config.learner, content)
        return self._model

    def forward(self, batch: dict[str, Tensor], reduction: str = "mean") -> tuple[Tensor, None]:
        """Mean square by which the actions of a batch differ from those that are planned in the
        situation of their episode. Before a fit, and in an episode whose first frame was not met,
        zeros stand for the plan.

        Parameters
        ----------
        batch
            With `episode_index` and `index`, as the training loop has them.
        reduction
            "mean", or "none" for one number for each frame.
        """
        state, environment, action = _rows(batch)
        episodes, indices = (batch[key].tolist() for key in ("episode_index", "index"))
        loss = np.empty(len(action))
        for k, (episode, index) in enumerate(zip(episodes, indices, strict=True)):
            begin, end = self._bounds.get(episode, (index, index + 1))
            frame = index - begin
            if self.training and not self._was_loaded:
                kept = self._seen.setdefault(episode, {})
                kept[frame] = (state[k], environment[k], action[k])
            if frame == 0 and episode not in self._expected and self.model is not None:
                self._expected[episode] = self.model.plan(state[k], environment[k])
            off = action[k]
            if episode in self._expected:
                plan = self._expected[episode]
                share = frame / max(end - begin - 1, 1)
                off = off - plan[round(share * (len(plan) - 1))]
            loss[k] = np.mean(off**2)
        made = torch.as_tensor(loss, dtype=torch.float32, device=self.without_gradient.device)
        made = made + 0.0 * self.without_gradient
        return (made if reduction == "none" else made.mean()), None

    def update(self) -> None:
        """Fit the model, once all episodes that were met are whole, and again when more are."""
        n_frames = sum(map(len, self._seen.values()))
        if n_frames == self._n_fitted or self._missing:
            return
        episodes = []
        for _, kept in sorted(self._seen.items()):
            columns = zip(*(kept[frame] for frame in sorted(kept)), strict=True)
            episodes.append(Episode(*(np.stack(column) for column in columns)))
        content = TaskModel(self.config.learner).fit(episodes).to_bytes()
        learned = torch.frombuffer(bytearray(content), dtype=torch.uint8)
        self.register_buffer(LEARNED, learned.to(self.without_gradient.device))
        self._n_fitted = n_frames
        self._model = None
        self._expected = {
            number: self.model.plan(one.state[0], one.environment[0])
            for number, one in zip(sorted(self._seen), episodes, strict=True)
        }

    def forget(self) -> None:
        """What was read from the buffer is read anew, for other bytes come into it."""
        self._model = None
        self._n_fitted = 0
        self._expected = {}
        self._seen = {}

    @property
    def _was_loaded(self) -> bool:
        return bool(self.get_buffer(LEARNED).numel()) and not self._n_fitted

    @property
    def _missing(self) -> int:
        """Frames that were not met, of the episodes that were."""
        whole = sum(end - begin for begin, end in map(self._bounds.__getitem__, self._seen))
        return whole - sum(map(len, self._seen.values()))

    def _save_pretrained(self, save_directory: Path, **others: Any) -> None:
        if not self.get_buffer(LEARNED).numel():
            raise ValueError(
                f"nothing is learned yet: {self._missing} frames of the episodes were not met;"
                " --steps must be at least frames / batch_size, in one process"
            )
        super()._save_pretrained(save_directory, **others)

    def predict_action_chunk(self, batch: dict[str, Tensor], **others: Any) -> Tensor:
        """Actions (batch, frames, action) of a whole movement that begins now.

        Raises
        ------
        ValueError
            If nothing was learned.
        """
        if self.model is None:
            raise ValueError("this policy has learned nothing: train it, or load one")
        state, environment, _ = _rows(batch)
        plans = [self.model.plan(*row) for row in zip(state, environment, strict=True)]
        return torch.as_tensor(np.stack(plans), dtype=torch.float32, device=batch[STATE].device)

    def select_action(self, batch: dict[str, Tensor], **others: Any) -> Tensor:
        """Action (batch, action) of now; after the end of the movement its last one."""
        if self._plan is None:
            self._plan = self.predict_action_chunk(batch)
        action = self._plan[:, min(self._next, self._plan.shape[1] - 1)]
        self._next += 1
        return action


def _rows(batch: dict[str, Tensor]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State, environment and action (n, .) of a batch; those that are missing have no elements."""
    nothing = torch.zeros((len(batch[STATE]), 0))
    # an observation alone comes with None for its action
    found = (batch.get(key) for key in (STATE, ENVIRONMENT, ACTION))
    state, environment, action = (
        (nothing if one is None else one).detach().cpu().double().numpy() for one in found
    )
    return state, environment, action


def _make_room(
    policy: DSGMRPolicy, state_dict: dict[str, Tensor], prefix: str, *others: Any
) -> None:
    """The buffer is as long as what is loaded into it."""
    if (loaded := state_dict.get(prefix + LEARNED)) is not None:
        buffer = torch.zeros_like(loaded, device=policy.without_gradient.device)
        policy.register_buffer(LEARNED, buffer)
        policy.forget()

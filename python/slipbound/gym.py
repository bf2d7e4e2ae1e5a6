"""Gymnasium environments of the simulated hand. Needs gymnasium: ``pip install './python[gym]'`` in a checkout.

>>> import gymnasium, slipbound.gym
>>> env = gymnasium.make("slipbound/HoldBottle-v0")
>>> observation, _ = env.reset(seed=1)
>>> observation["image"].shape
(480, 640, 3)
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ._errors import SettingError
from ._slipbound import Cycle, GripperState
from .control import Controller
from .lab import Hand

__all__ = ["HoldBottle", "ScrewCap", "register"]

#: Least and largest force per finger that can be commanded, N.
FORCES_N = (5.0, 60.0)
#: Names of the numbers in an observation; an unknown value is 0, and ``_known`` is 0 then.
NUMBERS = ("grip_n", "margin", "margin_known", "shear_x_px", "shear_y_px", "shear_rad", "slips")

Observation = dict[str, NDArray[Any]]


class _Told(Controller):
    """Holds with the force set by the environment."""

    force_n = 10.0

    def decide(self, now_ns: int, hand: dict[str, Any], gripper: GripperState) -> float:
        """Return that force."""
        return self.force_n


class _GripEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """The grip force is the action, one number in N per finger and cycle (1/30 s); the task moves the wrist.

    An observation is the left finger's image (uint8, H x W x 3, RGB) and :data:`NUMBERS`. The reward of a cycle is
    minus the commanded fraction of the largest force, minus a tenth of a point for every mm that the object slid; 100
    when the task ends well, minus 100 when it does not. While the jaws close, the task commands its own force and the
    action is ignored; once it releases, none is commanded.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}
    task = ""

    def __init__(self, render_mode: str | None = None, **parameters: str | float | bool) -> None:
        self.render_mode = render_mode
        self._parameters = {"fingers": 1, **parameters}
        self._told = _Told()
        self._hand = self._new_hand(0)
        width, height = self._hand.sensor().image_px
        self._image_shape = (height, width, 3)
        parts: dict[str, spaces.Space[Any]] = {
            "image": spaces.Box(0, 255, self._image_shape, np.uint8),
            "numbers": spaces.Box(-np.inf, np.inf, (len(NUMBERS),), np.float32),
        }
        self.action_space = spaces.Box(FORCES_N[0], FORCES_N[1], (1,), np.float32)
        space: Any = spaces.Dict(parts)
        self.observation_space = space
        self._cycle: Cycle | None = None
        self._slid_mm = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a new episode; the hand runs until the rest frames of its fingers are known."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(1 << 31))
        self._told.force_n = 10.0
        self._hand = self._new_hand(drawn)
        self._slid_mm = 0.0
        while True:
            self._cycle = self._hand.cycle()
            if self._cycle.outcome != "at_rest":
                return self._observation(), {"seed": drawn}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold with the force of the action for 1/30 s."""
        force_n = np.asarray(action, dtype=np.float64)
        if force_n.size != 1 or not np.isfinite(force_n).all():
            raise SettingError(f"action: expected one finite force in N, got {action!r:.100}")
        if self._cycle is None:
            raise gymnasium.error.ResetNeeded("reset() comes before step()")
        self._told.force_n = float(np.clip(force_n.item(), *FORCES_N))
        self._cycle = self._hand.cycle()
        truth = self._hand.truth
        slid_mm = truth["slid_mm"] - self._slid_mm
        self._slid_mm = truth["slid_mm"]
        ended, over = self._cycle.has_ended, self._cycle.outcome == "source_ended"
        # The commanded force: while the jaws close the action is ignored.
        reward = -(self._cycle.force_n or 0.0) / FORCES_N[1] - 0.1 * slid_mm
        if ended or over:
            reward += 100.0 if self._hand.score["succeeded"] else -100.0
        return self._observation(), reward, ended, over and not ended, {"slid_mm": self._slid_mm}

    def _new_hand(self, seed: int) -> Hand:
        parameters: dict[str, Any] = {**self._parameters, "seed": seed}
        return Hand(self.task, controller=self._told, **parameters)

    def render(self) -> NDArray[np.uint8] | None:
        """Return the image of the left finger, RGB."""
        return None if self.render_mode is None else self._observation()["image"]

    def _observation(self) -> Observation:
        cycle = self._cycle
        if cycle is None:
            raise gymnasium.error.ResetNeeded("reset() comes before render()")
        report = cycle.reports[0] if cycle.reports else None
        numbers = np.zeros(len(NUMBERS), np.float32)
        if report is not None:
            margin, shear = report.margin, report.shear
            numbers[0] = report.grip_n or 0.0
            if margin is not None:
                numbers[1:3] = margin.value, 1.0
            if shear is not None:
                numbers[3:6] = (*shear.translation_px, shear.rotation_rad)
            numbers[6] = report.slips
        image = cycle.image(0, order="RGB")
        return {"image": np.zeros(self._image_shape, np.uint8) if image is None else image, "numbers": numbers}


class HoldBottle(_GripEnv):
    """Lift a bottle that is filled and pulled, and hold it.

    Parameters
    ----------
    render_mode : {"rgb_array"} or None
        With ``rgb_array``, ``render()`` returns the image of the left finger.
    **parameters
        Keys of the scene, as :class:`slipbound.lab.Hand` takes them.
    """

    task = "lift"


class ScrewCap(_GripEnv):
    """Screw a cap onto a bottle.

    Parameters
    ----------
    render_mode : {"rgb_array"} or None
        With ``rgb_array``, ``render()`` returns the image of the left finger.
    **parameters
        Keys of the scene, as :class:`slipbound.lab.Hand` takes them.
    """

    task = "screw"


def register() -> None:
    """Register ``slipbound/HoldBottle-v0`` and ``slipbound/ScrewCap-v0``; done when this module is imported."""
    for name, entry in (("HoldBottle", HoldBottle), ("ScrewCap", ScrewCap)):
        id = f"slipbound/{name}-v0"
        if id not in gymnasium.registry:
            # Its own types are incomplete.
            gymnasium.register(id, entry_point=f"slipbound.gym:{entry.__name__}")  # pyright: ignore[reportUnknownMemberType]


register()

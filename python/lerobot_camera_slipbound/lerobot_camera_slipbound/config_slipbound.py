"""What the camera is made from."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.cameras.configs import CameraConfig


@CameraConfig.register_subclass("slipbound")
@dataclass(kw_only=True)
class SlipboundCameraConfig(CameraConfig):
    """A finger behind another LeRobot camera, or a recording.

    ``width``, ``height`` and ``fps``, which LeRobot wants of the cameras of a robot, are those of ``camera`` unless they
    are given; with ``source`` they have to be given.

    Attributes
    ----------
    camera : CameraConfig or None
        The camera in the finger, any that LeRobot knows; its pictures are RGB.
    source : str or None
        In place of a camera: what ``slipbound.watch`` opens. It begins anew when it is over.
    sensor : str or None
        The finger: a built-in name or its ``FILE.toml``; needed with a camera.
    settings : str or None
        Settings of the monitor: a ``FILE.toml`` or ``paper``.
    picture : str
        ``tactile``, the picture of the finger; or ``field``, the slip field: red and green are its x and y (128 is
        none, a pitch is 127), blue is 255 where a marker slips.
    """

    camera: CameraConfig | None = None
    source: str | None = None
    sensor: str | None = None
    settings: str | None = None
    picture: str = "tactile"

    def __post_init__(self) -> None:
        if (self.camera is None) == (self.source is None):
            raise ValueError("expected either camera or source, got both or none")
        if self.camera is not None and self.sensor is None:
            raise ValueError("sensor: expected a built-in name or FILE.toml with a camera, got none")
        if self.picture not in ("tactile", "field"):
            raise ValueError(f"picture: expected 'tactile' or 'field', got {self.picture!r}")
        for name in ("width", "height", "fps"):
            if self.camera is not None and getattr(self, name) is None:
                setattr(self, name, getattr(self.camera, name))

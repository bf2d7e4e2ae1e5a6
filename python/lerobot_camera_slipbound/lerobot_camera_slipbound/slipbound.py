"""The camera."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from lerobot.cameras.camera import Camera
from numpy.typing import NDArray

import slipbound

from .config_slipbound import SlipboundCameraConfig

#: The verdicts in the order of their numbers in the features.
STATES = ("no_contact", "unsure", "stick", "incipient", "gross", "unjudged")


#: For how many windows of the search for the rest frame ``connect`` waits.
_WARMUP_WINDOWS = 5


class SlipboundCamera(Camera):
    """A finger as LeRobot sees a camera. ``features`` are the numbers of the picture read last, to be put beside it.

    Parameters
    ----------
    config : SlipboundCameraConfig
        What it is made from.
    """

    def __init__(self, config: SlipboundCameraConfig) -> None:
        super().__init__(config)
        self.config = config
        self._camera: Camera | None = None
        self._watch: slipbound.Watch | None = None
        self._monitor: slipbound.Monitor | None = None
        self._sensor: slipbound.Sensor | None = None
        self._report: slipbound.Report | None = None
        self._image: NDArray[Any] | None = None
        self._picture: NDArray[np.uint8] | None = None

    @property
    def is_connected(self) -> bool:
        """Whether it is connected."""
        return self._watch is not None or (self._camera is not None and self._camera.is_connected)

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Return nothing: fingers stand behind other cameras, which find themselves."""
        return []

    def connect(self, warmup: bool = True) -> None:
        """Open the camera or the recording. With ``warmup`` the finger at rest is looked for: nothing may touch it.

        Raises
        ------
        slipbound.RestError
            When it is not found, as on a dark finger. Whatever is raised, nothing is left open.
        """
        if self.is_connected:
            raise ConnectionError("SlipboundCamera is connected already")
        try:
            self._connect(warmup)
        except BaseException:
            self._close()
            raise

    def _connect(self, warmup: bool) -> None:
        if self.config.camera is None:
            self._open()
        else:
            from lerobot.cameras.utils import make_cameras_from_configs

            self._camera = make_cameras_from_configs({"finger": self.config.camera})["finger"]
            self._camera.connect(warmup)
            sensor = self.config.sensor
            assert sensor is not None  # the config has seen to it
            self._monitor = slipbound.Monitor(sensor, settings=self.config.settings, order="RGB")
            self._sensor = self._monitor.sensor
        if warmup:
            self.read()
            if self._monitor is not None:
                self._find_rest(self._monitor)

    def _find_rest(self, monitor: slipbound.Monitor) -> None:
        count = _WARMUP_WINDOWS * monitor.settings.to_dict()["rest"]["window_count"]
        for _ in range(count - 1):  # one is read already
            if monitor.is_ready:
                return
            self.read()
        if not monitor.is_ready:
            why = None if self._report is None else self._report.reason
            raise slipbound.RestError(f"expected a finger at rest within {count} frames, got none: {why}")

    def _open(self) -> None:
        source = self.config.source
        assert source is not None  # the config has seen to it
        self._watch = slipbound.watch(source, self.config.sensor, self.config.settings)
        self._sensor = self._watch.sensor

    def read(self) -> NDArray[Any]:
        """Return the next picture, RGB, uint8, H x W x 3."""
        self._check()
        return self._show(self._next_of_recording() if self._camera is None else self._camera.read())

    def async_read(self, timeout_ms: float = 200) -> NDArray[Any]:
        """Return the next picture; a camera is waited for at most ``timeout_ms``."""
        self._check()
        return self._show(self._next_of_recording() if self._camera is None else self._camera.async_read(timeout_ms))

    def read_latest(self, max_age_ms: int = 500) -> NDArray[Any]:
        """Return the newest picture of the camera, at most ``max_age_ms`` old; of a recording the next one.

        What a robot calls for each of its observations. A frame is judged once, however often it is read.
        """
        self._check()
        return self._show(self._next_of_recording() if self._camera is None else self._camera.read_latest(max_age_ms))

    def disconnect(self) -> None:
        """Close it."""
        self._check()
        self._close()

    def _close(self) -> None:
        camera, watch = self._camera, self._watch
        self._camera = self._watch = self._monitor = self._sensor = None
        self._image = self._picture = None
        try:
            if camera is not None and camera.is_connected:
                camera.disconnect()
        finally:
            if watch is not None:
                watch.close()

    @property
    def features(self) -> dict[str, float]:
        """Numbers of the picture read last: place of the verdict in STATES, margin, shear of the gel in px and rad.

        A margin that is not known is NaN, and ``margin_known`` is 0 with it: it must not read as a safe one.
        """
        report = self._report
        if report is None:
            raise RuntimeError("no frame was read yet")
        shear = report.shear
        x_px, y_px = (0.0, 0.0) if shear is None else shear.translation_px
        return {
            "state": float(STATES.index(report.state)),
            "margin": math.nan if report.margin is None else report.margin.value,
            "margin_known": 0.0 if report.margin is None else 1.0,
            "shear_x_px": x_px,
            "shear_y_px": y_px,
            "shear_rad": 0.0 if shear is None else shear.rotation_rad,
        }

    def _check(self) -> None:
        if not self.is_connected:
            raise ConnectionError("SlipboundCamera is not connected")

    def _show(self, image: NDArray[Any]) -> NDArray[Any]:
        # LeRobot's cameras give the same array again until there is a newer one.
        if image is self._image and self._picture is not None:
            return self._picture
        if self._monitor is not None:
            self._report = self._monitor.step(image, time_ns=time.monotonic_ns())
        self._image = image
        self._picture = image if self.config.picture == "tactile" else self._field(image)
        self.height, self.width = self._picture.shape[:2]
        return self._picture

    def _next_of_recording(self) -> NDArray[Any]:
        for _ in range(2):
            assert self._watch is not None
            for report in self._watch:
                image = self._watch.image(order="RGB")
                if image is not None:
                    self._report = report
                    return image
            self._open()
        raise RuntimeError(f"{self.config.source}: no whole frame")

    def _field(self, image: NDArray[Any]) -> NDArray[np.uint8]:
        """Draw the slip field as a picture of the size of the camera's: a square of a pitch for every marker."""
        report, sensor = self._report, self._sensor
        height, width = image.shape[:2]
        picture = np.zeros((height, width, 3), np.uint8)
        picture[:, :, :2] = 128
        if report is None or sensor is None:
            return picture
        # The field is in px of the finger at the size of its frames, the sensor may be stated at another.
        scale = width / sensor.image_px[0]
        field, pitch_px = report.field, scale * sensor.pitch_px
        columns, rows = (scale * px for px in sensor.rectified_px)
        half = np.array([width / columns, height / rows]) * pitch_px / 2
        for at, slip, over in zip(field.now_px, field.slip_px, field.over, strict=True):
            middle = at * (width / columns, height / rows)
            left, top = np.clip(middle - half, 0, (width, height)).astype(int)
            right, bottom = np.clip(middle + half, 0, (width, height)).astype(int)
            x, y = (128 + 127 * np.clip(slip / pitch_px, -1, 1)).round()
            picture[top:bottom, left:right] = (x, y, 255 if over else 0)
        return picture

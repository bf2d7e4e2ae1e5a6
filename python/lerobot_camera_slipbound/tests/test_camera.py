"""Against the interface of the installed LeRobot; its torch is not needed for that."""

from __future__ import annotations

import math
import re
import runpy
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement

import slipbound

pytest.importorskip("lerobot")

from lerobot.cameras.camera import Camera  # noqa: E402
from lerobot.cameras.configs import CameraConfig  # noqa: E402
from lerobot_camera_slipbound import SlipboundCamera, SlipboundCameraConfig  # noqa: E402
from lerobot_camera_slipbound.slipbound import STATES  # noqa: E402

SOURCE = "sim:ramp?object=scissors&force_n=15&ramp_s=0.4&grid=fast&seed=3"


def test_lerobot_makes_it_from_its_config():
    from lerobot.cameras.utils import make_cameras_from_configs

    config = SlipboundCameraConfig(source=SOURCE)
    assert config.type == "slipbound" and CameraConfig.get_choice_class("slipbound") is SlipboundCameraConfig
    camera = make_cameras_from_configs({"finger": config})["finger"]
    assert isinstance(camera, SlipboundCamera) and isinstance(camera, Camera)


def test_lerobot_finds_the_distribution():
    names = [distribution.metadata["Name"] for distribution in metadata.distributions()]
    assert any(name.startswith("lerobot_camera_") for name in names)


def test_what_it_says_it_needs_is_what_it_is_tried_with():
    needed = [Requirement(text) for text in metadata.requires("lerobot_camera_slipbound")]
    unmet = [str(one) for one in needed if not one.specifier.contains(metadata.version(one.name), prereleases=True)]
    assert {one.name for one in needed} == {"slipbound", "lerobot"} and not unmet, unmet


def test_it_gives_pictures_and_numbers_until_it_is_disconnected():
    camera = SlipboundCamera(SlipboundCameraConfig(source=SOURCE))
    with pytest.raises(ConnectionError):
        camera.read()
    with camera:
        states, unknown = set(), 0
        for _ in range(45):
            image = camera.async_read()
            assert image.shape == (camera.height, camera.width, 3) and image.dtype == np.uint8
            states.add(STATES[int(camera.features["state"])])
            features = camera.features
            # An unknown margin must not read as a safe one.
            assert math.isnan(features["margin"]) == (features["margin_known"] == 0)
            unknown += features["margin_known"] == 0
        assert {"no_contact", "incipient"} <= states and 0 < unknown < 45
        assert not np.array_equal(camera.read_latest(), image), "the recording goes on"
    assert not camera.is_connected


def test_the_field_as_a_picture():
    with SlipboundCamera(SlipboundCameraConfig(source=SOURCE, picture="field")) as camera:
        pictures = [camera.read() for _ in range(40)]
    assert (pictures[0][:, :, 2] == 0).all()
    assert any((picture[:, :, 2] == 255).any() for picture in pictures)


class _Replay(Camera):
    """A camera of LeRobot's that plays simulated frames."""

    def __init__(self, config):
        super().__init__(config)
        self.simulation = None

    @property
    def is_connected(self):
        return self.simulation is not None

    @staticmethod
    def find_cameras():
        return []

    def connect(self, warmup=True):
        self.simulation = slipbound.lab.simulate(SOURCE.removeprefix("sim:"), rest_frames=30)

    def read(self):
        return next(self.simulation).image(order="RGB")

    def async_read(self, timeout_ms=200):
        return self.read()

    def disconnect(self):
        self.simulation = None


def test_behind_another_camera(monkeypatch, tmp_path):
    import lerobot.cameras.utils

    inner = CameraConfig.__subclasses__()[0]
    monkeypatch.setattr(lerobot.cameras.utils, "make_cameras_from_configs", lambda configs: {"finger": _Replay(inner)})
    monkeypatch.setattr(inner, "fps", 30, raising=False)
    monkeypatch.setattr(inner, "width", 427, raising=False)
    monkeypatch.setattr(inner, "height", 320, raising=False)
    sensor = tmp_path / "sensor.toml"
    sensor.write_text(slipbound.lab.simulate(SOURCE.removeprefix("sim:")).sensor.to_toml())
    config = SlipboundCameraConfig(camera=inner, sensor=str(sensor))
    with SlipboundCamera(config) as camera:
        states = {STATES[int(camera.features["state"])] for _ in range(40) if camera.read() is not None}
    assert "no_contact" in states and "incipient" in states


class _Small(_Replay):
    """The same camera at half its resolution."""

    def read(self):
        image = super().read()
        height, width = image.shape[:2]
        return image.reshape(height // 2, 2, width // 2, 2, 3).mean((1, 3)).astype(np.uint8)


def _behind(monkeypatch, tmp_path, camera, **config):
    import lerobot.cameras.utils

    inner = CameraConfig.__subclasses__()[0]
    for key, value in {"fps": 30, "width": None, "height": None}.items():
        monkeypatch.setattr(inner, key, value, raising=False)
    monkeypatch.setattr(lerobot.cameras.utils, "make_cameras_from_configs", lambda configs: {"finger": camera(inner)})
    sensor = tmp_path / "sensor.toml"
    sensor.write_text(slipbound.lab.simulate(SOURCE.removeprefix("sim:")).sensor.to_toml())
    return SlipboundCamera(SlipboundCameraConfig(camera=inner, sensor=str(sensor), **config))


def test_the_field_of_frames_of_another_size_is_the_same_picture(monkeypatch, tmp_path):
    slipping = []
    for kind in (_Replay, _Small):
        with _behind(monkeypatch, tmp_path, kind, picture="field") as camera:
            pictures = [camera.read() for _ in range(38)]
        shown = max((picture[:, :, 2] == 255 for picture in pictures), key=np.sum)
        # The middle of what slips, as a share of the picture: one marker more or less does not move it.
        slipping.append(np.median(np.argwhere(shown) / shown.shape, axis=0))
    assert np.abs(np.subtract(*slipping)).max() < 0.05, slipping


class _Newest(_Replay):
    """A camera whose newest picture is read twice."""

    reads_count = 0

    def read_latest(self, max_age_ms=500):
        self.reads_count += 1
        if self.reads_count % 2:
            self.newest = self.read()
        return self.newest


def test_who_only_reads_the_latest_gets_new_pictures_and_each_is_judged_once(monkeypatch, tmp_path):
    with _behind(monkeypatch, tmp_path, _Newest) as camera:
        reads = [(camera.read_latest(), camera.features, camera._report.frame) for _ in range(40)]
    frames = [frame for *_, frame in reads]
    assert frames[::2] == frames[1::2] == list(range(frames[0], frames[0] + 20))
    assert all(first[0] is second[0] for first, second in zip(reads[::2], reads[1::2], strict=True))
    assert STATES[int(reads[-1][1]["state"])] not in ("no_contact", "unjudged"), "it has touched something"


class _Dark(_Replay):
    """A camera without light."""

    all = []

    def __init__(self, config):
        super().__init__(config)
        self.all.append(self)
        self.reads_count = 0

    def read(self):
        self.reads_count += 1
        assert self.reads_count < 1000, "it reads for ever"
        return np.zeros((480, 640, 3), np.uint8)


def test_a_dark_finger_ends_connect_and_leaves_nothing_open(monkeypatch, tmp_path):
    camera = _behind(monkeypatch, tmp_path, _Dark)
    for _ in range(2):
        with pytest.raises(slipbound.RestError, match="at rest within 100 frames, got none: .*dark"):
            camera.connect()
        assert not camera.is_connected and not _Dark.all[-1].is_connected


def test_the_configs_of_the_readme_are_accepted_in_a_robot():
    import lerobot
    import yaml

    # By its path: the package around it loads the drivers of all robots.
    robot_config = runpy.run_path(str(Path(lerobot.__path__[0]) / "robots" / "config.py"))["RobotConfig"]

    @dataclass(kw_only=True)
    class Robot(robot_config):
        cameras: dict[str, CameraConfig]

    @dataclass(kw_only=True)
    class Inner(CameraConfig):
        index_or_path: int

    readme = (Path(__file__).parents[1] / "README.md").read_text()
    configs = yaml.safe_load(re.search(r"```yaml\n(.*?)```", readme, re.DOTALL)[1])["cameras"]
    for options in configs.values():
        assert options.pop("type") == "slipbound"
        inner = options.pop("camera", None)
        assert inner is None or inner.pop("type") == "opencv"
        config = SlipboundCameraConfig(camera=inner and Inner(**inner), **options)
        Robot(cameras={"finger": config})
        assert (config.width, config.height, config.fps) == (640, 480, 30)


def test_configs_that_cannot_be():
    for wrong in ({}, {"source": "a", "camera": "b"}, {"camera": "b"}, {"source": "a", "picture": "none"}):
        with pytest.raises(ValueError, match="expected"):
            SlipboundCameraConfig(**wrong)

"""A frame in, a report out: the same bits as in Rust, whatever the layout of the array."""

from __future__ import annotations

import copy
import json
import pickle

import numpy as np
import pytest

import slipbound
from conftest import SCENE
from slipbound import _slipbound as native
from slipbound.lab import SimulatedFrame


def stepped(monitor: slipbound.Monitor, frames: list[SimulatedFrame], **options: object) -> list[str]:
    return [monitor.step(f.image(), time_ns=f.time_ns, **options).to_json(markers=True) for f in frames]


def new_monitor(frames: list[SimulatedFrame], sensor: slipbound.Sensor) -> slipbound.Monitor:
    return slipbound.Monitor(sensor, rest=[f.image() for f in frames[:5]])


def test_it_says_when_it_slips(frames, monitor):
    reports = [monitor.step(f.image(), time_ns=f.time_ns) for f in frames]
    assert reports[0].state == "no_contact" and not reports[0].slips
    assert any(r.slips for r in reports)
    slipping = next(r for r in reports if r.slips)
    assert slipping.motion is not None and slipping.contact.area_mm2 > 0
    assert slipping.field.slip_px.shape == (len(slipping.field), 2)
    assert slipping.field.over.dtype == np.bool_
    assert slipping.markers.matched == slipping.field.matched.sum()
    moved = slipping.field.now_px - slipping.field.rest_px
    assert np.array_equal(moved, slipping.field.now_from_rest_px)
    assert "incipient" in repr(slipping) or "gross" in repr(slipping)


def test_a_rest_that_tare_kept_is_the_one_that_is_found(frames, sensor, tmp_path):
    kept = tmp_path / "finger.rest"
    assert native.run(["slipbound", "tare", f"sim:{SCENE}", "--frames", "10", "-o", str(kept)]) == 0
    found = slipbound.Monitor(sensor, rest="auto")
    auto = [found.step(f.image(), time_ns=f.time_ns) for f in frames][-1]
    by_path, by_bytes = slipbound.Monitor(sensor, rest=kept), slipbound.Monitor(sensor, rest=kept.read_bytes())
    reports = [by_path.step(f.image(), time_ns=f.time_ns) for f in frames]
    assert reports[0].state == "no_contact" and any(r.slips for r in reports)
    assert np.array_equal(reports[-1].field.rest_px, auto.field.rest_px)
    assert stepped(by_bytes, frames) == [r.to_json(markers=True) for r in reports]
    with pytest.raises(slipbound.SettingError, match="damaged"):
        slipbound.Monitor(sensor, rest=kept.read_bytes()[:-1])
    with pytest.raises(slipbound.SettingError, match="another finger"):
        slipbound.Monitor("gelslim3", rest=str(kept))


def test_layouts_of_an_array_change_no_bit(frames, sensor):
    expected = stepped(new_monitor(frames, sensor), frames)
    canvas = np.zeros((500, 700, 3), np.uint8)

    def crop(image):
        canvas[10 : 10 + image.shape[0], 20 : 20 + image.shape[1]] = image
        return canvas[10 : 10 + image.shape[0], 20 : 20 + image.shape[1]]

    layouts = {
        "rgb": (lambda a: np.ascontiguousarray(a[:, :, ::-1]), "RGB"),
        "reversed channels": (lambda a: a[:, :, ::-1], "RGB"),
        "crop": (crop, None),
        "reversed rows": (lambda a: np.ascontiguousarray(a[::-1])[::-1], None),
        "reversed columns": (lambda a: np.ascontiguousarray(a[:, ::-1])[:, ::-1], None),
        "column-major": (np.asfortranarray, None),
        "transposed": (lambda a: np.ascontiguousarray(a.transpose(1, 0, 2)).transpose(1, 0, 2), None),
        "first of four channels": (lambda a: np.dstack([a, a[:, :, :1]])[:, :, :3], None),
        "read-only": (lambda a: (a.setflags(write=False), a)[1], None),
    }
    for name, (layout, order) in layouts.items():
        monitor = new_monitor(frames, sensor)
        got = [
            monitor.step(layout(f.image()), time_ns=f.time_ns, order=order).to_json(markers=True) for f in frames
        ]
        assert got == expected, name


def test_grey_frames_of_two_and_of_three_axes_are_the_same(frames, sensor):
    views = [f.image()[:, :, 1] for f in frames]
    grey = [np.ascontiguousarray(view) for view in views]
    one, other, viewing = (slipbound.Monitor(sensor, rest=grey[:5]) for _ in range(3))
    for image, view in zip(grey, views):
        expected = one.step(image).to_json()
        assert other.step(image[:, :, np.newaxis]).to_json() == viewing.step(view).to_json() == expected


def test_rest_is_found_among_the_first_frames(frames, sensor):
    monitor = slipbound.Monitor(sensor, rest="auto")
    assert not monitor.is_ready
    waiting = [monitor.step(frames[0].image()) for _ in range(20)]
    assert {r.state for r in waiting} == {"unjudged"}
    assert "looked for among the first 20 frames" in waiting[0].reason
    assert json.loads(waiting[0].to_json())["reason"] == waiting[0].reason
    assert waiting[0].to_row()["markers_lost"] is None, "not measured"
    assert monitor.is_ready and monitor.refusal is None
    assert monitor.step(frames[0].image()).state == "no_contact"


@pytest.mark.parametrize("scale", [0.5, 2])
def test_overlays_have_one_size_while_the_rest_frame_is_searched_and_after(frames, sensor, scale):
    def scaled(image):
        return image[::2, ::2] if scale == 0.5 else image.repeat(2, 0).repeat(2, 1)

    monitor = slipbound.Monitor(sensor, rest="auto")
    images = [scaled(frame.image()) for frame in frames[:22]]
    drawn = [slipbound.overlay(image, monitor.step(image)) for image in images]
    assert monitor.is_ready and len({picture.shape for picture in drawn}) == 1
    assert (drawn[0] > 40).mean() > 0.5, "the frame is in it"


def test_frame_of_another_size_is_unjudged_as_in_rust(monitor, frames):
    report = monitor.step(frames[0].image()[:100])
    assert report.state == "unjudged" and report.reason == "frame size: expected 640x480, got 640x100"


def test_a_frame_that_was_not_measured_has_no_marker_that_is_found_or_slips(monitor, frames):
    slipping = [monitor.step(f.image()) for f in frames][-1]
    assert slipping.field.matched.any() and slipping.field.over.any() and slipping.field.slip_px.any()
    for image in (np.zeros_like(frames[0].image()), frames[0].image()[:100]):
        report = monitor.step(image)
        assert report.state == "unjudged" and report.markers.matched == 0 == report.field.matched.sum()
        assert not any(flags.any() for flags in (report.field.in_contact, report.field.inner, report.field.over))
        assert not report.field.slip_px.any()
        assert np.array_equal(report.field.now_px, slipping.field.now_px), "where they were last"
        line = report.to_dict(markers=True)
        assert len(line["lost_ids"]) == len(report.field) and all(row[5:] == [0] * 5 for row in line["field"])


@pytest.mark.parametrize("odd_at", [0, 7])
def test_a_frame_of_a_wrong_shape_before_the_rest_frame_is_a_report(frames, sensor, odd_at):
    monitor = slipbound.Monitor(sensor, rest="auto")
    for i in range(21):
        if i == odd_at:
            report = monitor.step(np.zeros((100, 300, 3), np.uint8))
            assert report.state == "unjudged" and "frames of 300x100" in report.reason
        else:
            report = monitor.step(frames[0].image())
    assert monitor.is_ready, "the others are looked at as if it had not come"


def test_a_camera_that_changes_its_size_before_the_rest_frame_is_looked_at_anew(frames, sensor):
    monitor = slipbound.Monitor(sensor, rest="auto")
    monitor.step(frames[0].image()[::2, ::2])
    reports = [monitor.step(frames[0].image()) for _ in range(21)]
    assert [report.state for report in reports] == ["unjudged"] * 20 + ["no_contact"]


def test_a_dict_is_the_json_line(monitor, frames):
    for f in frames:
        report = monitor.step(f.image(), grip_n=15.0, time_ns=f.time_ns)
        assert report.to_dict() == json.loads(report.to_json())
    fields = report.to_dict()
    assert fields["finger"] == "finger" and fields["frame"] == len(frames) - 1 == fields["seq"]
    assert fields["grip_n"] == report.grip_n == 15
    assert fields["state"] == report.state and fields["contact"]["area_px2"] == report.contact.area_px2
    for name in ("stick_ratio", "margin", "shear_n", "torque_nmm", "friction"):
        estimate, written = getattr(report, name), fields[name]
        assert (estimate is None) == (written is None)
        assert estimate is None or abs(estimate.value - written["value"]) <= 0.5e-4
    assert set(report.to_row()) == set(slipbound.rows([monitor.step(frames[0].image())])[0])


def test_an_overlay_of_an_earlier_report(monitor, frames):
    reports = [monitor.step(f.image()) for f in frames]
    pictures = [slipbound.overlay(frames[i].image(), reports[i]) for i in (0, -1)]
    assert pictures[0].shape == pictures[1].shape and pictures[0].shape[2] == 3
    assert pictures[0].dtype == np.uint8 and not np.array_equal(*pictures)
    rgb = slipbound.overlay(frames[-1].image(order="RGB"), reports[-1], order="RGB")
    assert np.array_equal(rgb[:, :, ::-1], pictures[1])


def test_sensors_and_settings_survive_being_written(sensor, tmp_path):
    for name in slipbound.sensors():
        known = slipbound.Sensor(name)
        assert slipbound.Sensor.from_toml(known.to_toml()) == known
        file = tmp_path / f"{name}.toml"
        file.write_text(known.to_toml())
        assert slipbound.Sensor(file) == known and known.to_dict()["name"] == name == known.name
    paper = slipbound.Settings.paper()
    assert slipbound.Settings("paper") == paper == slipbound.Settings.from_toml(paper.to_toml())
    assert slipbound.Settings() != paper and "paper" in repr(paper)
    mine = slipbound.Settings.from_toml("[rest]\nwindow_count = 3\n")
    assert mine.to_dict()["rest"]["window_count"] == 3
    monitor = slipbound.Monitor(sensor, settings=mine)
    assert monitor.settings == mine and monitor.sensor == sensor


def test_sensors_and_settings_go_to_other_processes(sensor):
    for thing in [sensor, slipbound.Sensor("gelsight"), slipbound.Settings.paper()]:
        assert pickle.loads(pickle.dumps(thing)) == thing == copy.deepcopy(thing)


def test_a_finger_is_calibrated_from_its_picture():
    at_rest = next(slipbound.lab.simulate("ramp", seed=3, camera="gelsight_mini")).image()
    mine = slipbound.calibrate(at_rest, name="mine", pitch_mm=1.5)
    assert mine.name == "mine" and mine.pitch_mm == 1.5
    assert slipbound.Monitor(mine, rest=at_rest).step(at_rest).state == "no_contact"
    with pytest.raises(slipbound.CalibrationError):
        slipbound.calibrate(np.full((240, 320, 3), 128, np.uint8))


def test_grey_pictures_in_one_array_are_several():
    colour = next(slipbound.lab.simulate("ramp", seed=3, camera="gelsight_mini")).image()
    grey = np.ascontiguousarray(colour[:, :, 1])
    known = slipbound.calibrate([grey, grey])
    assert slipbound.calibrate(np.stack([grey, grey])) == known == slipbound.calibrate(grey)
    assert slipbound.calibrate(np.stack([colour, colour])) == slipbound.calibrate(colour)
    with pytest.raises(slipbound.FrameError, match="take the fourth channel off"):
        slipbound.calibrate(np.dstack([colour, grey]))


def test_the_name_of_the_finger_is_in_its_reports(frames, sensor):
    named = slipbound.Monitor(sensor, rest=frames[0].image(), finger="left")
    report = named.step(frames[0].image())
    assert named.finger == report.finger == "left" and report.to_dict()["finger"] == "left"
    assert slipbound.Monitor(sensor).finger == "finger"

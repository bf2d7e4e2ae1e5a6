"""A detector written in Python is judged like those of ``slipbound eval``."""

from __future__ import annotations

import pytest

import slipbound
from slipbound.lab import Detector, judge_ramps, ramps_tables


class Unresponsive(Detector):
    """Never responds, and records its calls."""

    def __init__(self):
        self.calls = []

    def begin(self):
        self.calls.append("begin")

    def restart(self):
        self.calls.append("restart")

    def see(self, report, image):
        self.calls.append((report.seq, len(report.field), image.shape))
        return 0.0


def test_it_sees_every_frame_and_its_record_stands_beside_the_others():
    unresponsive = Unresponsive()
    records = judge_ramps(unresponsive, 1, seed=5, beside=["paper"])
    assert [(r["detector"], r["number"], r["truth"]) for r in records] == [("mine", 0, True), ("paper", 0, True)]
    assert (records[0]["outcome"], records[0]["first_alarm_frame"], records[0]["score"]) == ("missed", None, 0.0)
    frames = [call for call in unresponsive.calls if isinstance(call, tuple)]
    assert unresponsive.calls[0] == "begin" and unresponsive.calls.count("restart") == 1 and len(frames) > 20
    seqs = [seq for seq, _, _ in frames]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    assert all(markers > 100 and len(shape) == 3 for _, markers, shape in frames)
    table = ramps_tables(records)[0]
    assert "| mine | 1 | 0.0" in table and "| paper | 1 |" in table


def test_what_it_raises_comes_out():
    class Broken(Unresponsive):
        def see(self, report, image):
            raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        judge_ramps(Broken(), 1, beside=[])

    class Wordy(Unresponsive):
        def see(self, report, image):
            return "much"

    with pytest.raises(TypeError):
        judge_ramps(Wordy(), 1, beside=[])


@pytest.mark.parametrize(
    ("name", "threshold", "beside", "words"),
    [("paper", 1.0, [], "name"), ("mine", float("nan"), [], "threshold"), ("mine", 1.0, ["nobody"], "nobody")],
)
def test_what_cannot_be_is_refused(name, threshold, beside, words):
    detector = Unresponsive()
    detector.name, detector.threshold = name, threshold
    with pytest.raises(slipbound.SettingError, match=words):
        judge_ramps(detector, 1, beside=beside)


def test_records_of_another_kind_are_refused():
    with pytest.raises(slipbound.SettingError, match="judge_ramps"):
        ramps_tables([{"mine": 1}])

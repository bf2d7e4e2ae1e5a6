"""The examples in docstrings, and every Python line of docs/python.md."""

from __future__ import annotations

import doctest
import re
import subprocess
import sys

import pytest

import slipbound
from conftest import ROOT

PAGES = [ROOT / "docs" / "python.md"]


@pytest.mark.parametrize("name", ["slipbound", "slipbound.lab", "slipbound.gym", "slipbound._rows", "slipbound.control"])
def test_examples_in_docstrings(name):
    if name.endswith("gym"):
        pytest.importorskip("gymnasium")
    pytest.importorskip("pandas")
    module = __import__(name, fromlist=["_"])
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS, extraglobs={"slipbound": slipbound})
    assert result.failed == 0
    if name != "slipbound._rows" and name != "slipbound.control":
        assert result.attempted > 0


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_run_as_they_stand(page, tmp_path, monkeypatch):
    pytest.importorskip("pandas")
    pytest.importorskip("gymnasium")
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    assert blocks
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    for n, block in enumerate(blocks):
        exec(compile(block, f"{page.name} block {n + 1}", "exec"), names)


@pytest.mark.parametrize("example", sorted((ROOT / "python" / "examples").glob("*.py")), ids=lambda path: path.name)
def test_examples_run(example, tmp_path):
    if example.name == "rerun_log.py":
        pytest.importorskip("rerun")
    if example.name == "eval_dask.py":
        pytest.importorskip("distributed")
    done = subprocess.run([sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_everything_public_is_documented_and_listed():
    for name in slipbound.__all__:
        thing = getattr(slipbound, name)
        if name != "__version__":
            assert thing.__doc__, name
        if isinstance(thing, type) and thing.__module__ == "slipbound":
            for attribute in vars(thing):
                if not attribute.startswith("_"):
                    assert getattr(thing, attribute).__doc__, f"{name}.{attribute}"

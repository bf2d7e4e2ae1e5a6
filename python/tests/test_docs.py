"""The examples in docstrings, and every Python line of docs/python.md."""

from __future__ import annotations

import doctest
import importlib
import inspect
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
    def printed(*arguments: str) -> str:
        done = subprocess.run([sys.executable, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    if example.name == "rerun_log.py":
        pytest.importorskip("rerun")
    if example.name == "eval_dask.py":
        pytest.importorskip("distributed")
        sweep = ("table1", "--trials", "8", "--pictures", "0")
        one_process = printed("-m", "slipbound", "eval", *sweep, "-o", "one").partition("\nreport:")[0]
        assert "| ours |" in one_process
        assert printed(str(example), "table1", "8").partition("\nreport:")[0] == one_process
        return
    assert printed(str(example))


@pytest.mark.parametrize("name", ["slipbound", "slipbound.control", "slipbound.lab", "slipbound.gym", "slipbound.rerun"])
def test_docstrings_name_every_argument_and_what_is_returned(name):
    validate = pytest.importorskip("numpydoc.validate").validate
    needs = {"slipbound.gym": "gymnasium", "slipbound.rerun": "rerun"}
    pytest.importorskip(needs.get(name, "slipbound"))
    module = importlib.import_module(name)
    things = {f"{name}.{thing}": getattr(module, thing) for thing in module.__all__}
    things = {path: thing for path, thing in things.items() if inspect.isclass(thing) or inspect.isroutine(thing)}
    for path, kind in [(path, thing) for path, thing in things.items() if inspect.isclass(thing)]:
        things |= {f"{path}.{member}": what for member, what in vars(kind).items() if not member.startswith("_")}
    errors = [(path, code, text) for path in things for code, text in validate(path)["errors"]]
    wrong = [error for error in errors if error[1] in ("PR01", "PR02", "RT01")]
    assert not wrong


def test_everything_public_is_documented_and_listed():
    for name in slipbound.__all__:
        thing = getattr(slipbound, name)
        if name != "__version__":
            assert thing.__doc__, name
        if isinstance(thing, type) and thing.__module__ == "slipbound":
            for attribute in vars(thing):
                if not attribute.startswith("_"):
                    assert getattr(thing, attribute).__doc__, f"{name}.{attribute}"

"""The API fuzzer, for a short while; `make fuzz-api` runs it for long."""

from __future__ import annotations

import os
import pathlib
import random

import api_fuzz
import api_values
import pytest

from ipm_rs import errors

SECONDS = float(os.environ.get("API_FUZZ_SECONDS", "10"))


def test_every_name_has_right_calls(tmp_path, monkeypatch):
    """Where none of a dozen calls returns, the fuzzer tries nothing: give `api_values` the arguments of a new name."""
    monkeypatch.chdir(tmp_path)
    api_values.write_files(tmp_path)
    for name, recipe in api_values.names().items():
        errors = []
        for attempt in range(12):
            function, arguments = recipe(api_values.Values(random.Random(f"{name} {attempt}"), tmp_path))
            try:
                function(**arguments)
                break
            except Exception as error:
                errors.append(error)
        else:
            pytest.fail(f"{name}: {errors[-1]!r}")


@pytest.mark.slow
def test_a_while_of_spoiled_calls():
    made, problems = api_fuzz.run(20_26, 1_000_000, seconds=SECONDS)
    assert not problems, "\n".join(f"--seed {p['seed']} --call {p['call']}: {p['problem']}" for p in problems)
    assert made > 20, f"{made} calls in {SECONDS} s"


def test_the_fuzzer_sees_what_is_wrong():
    """An error that is not ours, and an interrupt that no argument raised."""
    assert "ValueError" in (api_fuzz.complaint("f", ValueError("no")) or "")
    assert api_fuzz.complaint("f", KeyboardInterrupt("of the user")) is not None
    assert api_fuzz.complaint("f", TypeError("f() missing 1 required positional argument: 'a'")) is None
    assert api_fuzz.complaint("f", errors.GridError("yes")) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "told"),
    [("ctypes.string_at(0)", "SIGSEGV"), ("os._exit(7)", "exit status 7"), ('"it is wrong"', "it is wrong")],
)
def test_the_fuzzer_tells_of_crashes_with_their_call(fault, told, tmp_path, monkeypatch):
    source = pathlib.Path(api_fuzz.__file__)
    script = tmp_path / "spoiled.py"
    text = source.read_text().replace("caller.problem(number)", f"({fault} if number == 3 else None)")
    script.write_text(text)
    monkeypatch.setenv("PYTHONPATH", str(source.parent))
    made, problems = api_fuzz.run(5, 6, script=str(script))
    assert made == 6
    (problem,) = problems
    assert (problem["seed"], problem["call"]) == (5, 3) and told in problem["problem"]

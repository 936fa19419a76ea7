"""What the command line shows on a terminal and to shells: colours, width, JSON, completion."""

from __future__ import annotations

import io
import json
import shutil
import subprocess

import pytest

from ipm_rs import cli
from ipm_rs.cli import printing


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "environment", "coloured"),
    [
        (Terminal, {}, True),
        (Terminal, {"NO_COLOR": ""}, True),
        (Terminal, {"NO_COLOR": "1"}, False),
        (Terminal, {"TERM": "dumb"}, False),
        (io.StringIO, {}, False),
    ],
)
def test_colours_are_for_terminals_that_want_them(stream, environment, coloured, monkeypatch):
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    out = stream()
    printing.emit("ipm-rs: error: no such file", out)
    printing.emit("a.png: error: this is no mark", out)
    first, second = out.getvalue().splitlines()
    assert first == ("\x1b[1;31mipm-rs: error:\x1b[0m no such file" if coloured else "ipm-rs: error: no such file")
    assert second == "a.png: error: this is no mark"


@pytest.mark.parametrize("command", [[], ["warp"], ["rig"], ["cloud"], ["lut"], ["demo"], ["info"], ["completion"]])
def test_help_is_as_wide_as_the_terminal(command, capsys, monkeypatch):
    lines = {}
    for columns in (80, 160):
        monkeypatch.setenv("COLUMNS", str(columns))
        assert cli.main([*command, "--help"]) == 0
        text, examples = capsys.readouterr().out.split("Examples:\n")
        lines[columns] = text.splitlines()
        assert max(map(len, lines[columns])) <= columns and "  ipm-rs" in examples
    assert len(lines[160]) <= len(lines[80])


def test_info_for_programs(capsys):
    assert cli.main(["info", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["numpy"] and facts["isa"] in facts["available_isas"] and "rosbags" in facts


def complete(script: str, *words: str) -> list[str]:
    """What bash offers for the last of the words."""
    typed = " ".join(f"'{word}'" for word in words)
    program = (
        f"{script}\nCOMP_WORDS=({typed}); COMP_CWORD={len(words) - 1}; _ipm_rs; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    found = subprocess.run(["bash", "-c", program], capture_output=True, text=True, timeout=20)
    assert not found.stderr
    return found.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes(capsys):
    assert cli.main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    assert complete(script, "ipm-rs", "wa") == ["warp"]
    assert complete(script, "ipm-rs", "warp", "--skip") == ["--skip-existing"]
    assert complete(script, "ipm-rs", "warp", "a.json", "--interpolation", "n") == ["nearest"]
    assert complete(script, "ipm-rs", "completion", "z") == ["zsh"]
    assert complete(script, "ipm-rs", "warp", "a.js") == []  # left to bash, which knows files


@pytest.mark.parametrize(("shell", "check"), [("zsh", ["zsh", "-n"]), ("fish", ["fish", "--no-execute"])])
def test_other_shells_take_their_scripts(shell, check, capsys, tmp_path):
    assert cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "warp" in script and "skip-existing" in script and "nearest" in script
    # of zsh's _arguments, one rest argument is allowed
    assert shell != "zsh" or max(line.count("'*:") for line in script.splitlines() if "_arguments" in line) == 1
    if shutil.which(shell) is None:
        pytest.skip(f"needs {shell}")
    (tmp_path / "script").write_text(script)
    found = subprocess.run([*check, str(tmp_path / "script")], capture_output=True, text=True, timeout=20)
    assert found.returncode == 0 and not found.stderr

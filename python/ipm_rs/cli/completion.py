"""``ipm-rs completion``: a script that makes a shell complete commands, options and their words.

Made of the parser itself, so that it knows every option; the shells complete names of files on their own.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator

from ipm_rs.cli.arguments import Commands, Parser
from ipm_rs.cli.printing import emit


def add(commands: Commands) -> None:
    """Add the command and its argument."""
    completion = commands.add_parser(
        "completion",
        help="print what makes a shell complete commands and options",
        description="Print a script that makes a shell complete the commands, their options and the options' words.",
        examples="""\
  ipm-rs completion bash > ~/.local/share/bash-completion/completions/ipm-rs
  ipm-rs completion zsh > "${fpath[1]}/_ipm-rs"
  ipm-rs completion fish > ~/.config/fish/completions/ipm-rs.fish""",
    )
    completion.add_argument("shell", choices=tuple(_SCRIPTS), help="which shell")
    completion.set_defaults(run=lambda args: emit(_SCRIPTS[args.shell](commands.choices)))


Parsers = dict[str, Parser]


def _options(parser: Parser) -> Iterator[argparse.Action]:
    """Give the options that are shown in the help."""
    return (action for action in parser._actions if action.option_strings and action.help is not argparse.SUPPRESS)


def _words(action: argparse.Action) -> str:
    return " ".join(map(str, action.choices or ()))


def _bash(commands: Parsers) -> str:
    options = "\n".join(
        f'    {name}) words="{" ".join(word for action in _options(parser) for word in action.option_strings)}" ;;'
        for name, parser in commands.items()
    )
    values = "\n".join(
        f'    "{name} {word}") words="{_words(action)}" ;;'
        for name, parser in commands.items()
        for action in _options(parser)
        if action.choices
        for word in action.option_strings
    )
    positional = "\n".join(
        f'    {name}) [[ $cur == -* ]] || words="{_words(action)}" ;;'
        for name, parser in commands.items()
        for action in parser._actions
        if action.choices and not action.option_strings
    )
    return f"""\
# bash completion of ipm-rs
_ipm_rs() {{
  local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} command=${{COMP_WORDS[1]}} words=""
  COMPREPLY=()
  if (( COMP_CWORD == 1 )); then
    words="{" ".join(commands)} --help --version"
  elif [[ $cur == -* ]]; then
    case $command in
{options}
    esac
  else
    case "$command" in
{positional}
    esac
    case "$command $prev" in
{values}
    esac
  fi
  [[ -n $words ]] && COMPREPLY=($(compgen -W "$words" -- "$cur"))
}}
complete -o default -F _ipm_rs ipm-rs"""


def _zsh(commands: Parsers) -> str:
    listed = " ".join(_quoted(f"{name}:{_help(parser)}") for name, parser in commands.items())
    cases = []
    for name, parser in commands.items():
        specs = []
        for action in parser._actions:
            if action.help is argparse.SUPPRESS:
                continue
            words = f"({_words(action)})" if action.choices else "_files"
            if not action.option_strings:
                specs.append(_quoted(f"{'*' if action.nargs == '+' else ''}:{action.dest}:{words}"))
                continue
            text = _plain(action.help).replace("[", r"\[").replace("]", r"\]")
            values = "" if action.nargs == 0 else f":{action.dest}:{words}" * (_count(action))
            specs += [_quoted(f"{word}[{text}]{values}") for word in action.option_strings]
        cases.append(f"    {name}) _arguments {' '.join(specs)} ;;")
    return f"""\
#compdef ipm-rs
_ipm_rs() {{
  local -a commands
  commands=({listed})
  if (( CURRENT == 2 )); then
    _describe command commands
    return
  fi
  local command=$words[2]
  shift words
  (( CURRENT-- ))
  case $command in
{chr(10).join(cases)}
  esac
}}
compdef _ipm_rs ipm-rs"""


def _fish(commands: Parsers) -> str:
    lines = ["# fish completion of ipm-rs"]
    for name, parser in commands.items():
        lines.append(f"complete -c ipm-rs -n __fish_use_subcommand -f -a {name} -d {_fish_quoted(_help(parser))}")
    for name, parser in commands.items():
        start = f"complete -c ipm-rs -n '__fish_seen_subcommand_from {name}'"
        for action in parser._actions:
            if action.help is argparse.SUPPRESS:
                continue
            text = _fish_quoted(_plain(action.help))
            if not action.option_strings:
                if action.choices:
                    lines.append(f"{start} -f -a {_fish_quoted(_words(action))} -d {text}")
                continue
            names = " ".join(
                f"-l {word[2:]}" if word[:2] == "--" else f"-s {word[1:]}" for word in action.option_strings
            )
            takes = "" if action.nargs == 0 else f" -x -a {_fish_quoted(_words(action))}" if action.choices else " -r"
            lines.append(f"{start} {names}{takes} -d {text}")
    return "\n".join(lines)


_SCRIPTS: dict[str, Callable[[Parsers], str]] = {"bash": _bash, "zsh": _zsh, "fish": _fish}


def _help(parser: Parser) -> str:
    """Return the first sentence of a command's description."""
    return _plain(parser.description).partition(". ")[0].rstrip(".").replace(":", r"\:")


def _plain(text: str | None) -> str:
    """Return a help text in one line, with argparse's own percent signs as they are shown."""
    return " ".join((text or "").replace("%%", "%").split())


def _count(action: argparse.Action) -> int:
    return action.nargs if isinstance(action.nargs, int) else 1


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def _fish_quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"

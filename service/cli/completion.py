"""`mpe completion`: completion of commands and options for bash and zsh."""

from __future__ import annotations

import argparse

_BASH = """\
_mpe() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" words=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        words="{commands}"
    elif [[ "$word" == -* ]]; then
        case "${{COMP_WORDS[1]}}" in
{cases}
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _mpe mpe"""
_ZSH = "autoload -U +X compinit && compinit\nautoload -U +X bashcompinit && bashcompinit\n"


def add_completion(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    completion = commands.add_parser(
        "completion",
        help="print the completion for a shell: source <(mpe completion bash)",
    )
    completion.add_argument("shell", choices=("bash", "zsh"))


def render_completion(parser: argparse.ArgumentParser, shell: str) -> str:
    """Return a script that completes what the parser takes."""
    commands = _find_commands(parser)
    cases = "\n".join(
        f'            {name}) words="{" ".join(_list_options(command))}" ;;'
        for name, command in commands.items()
    )
    script = _BASH.format(commands=" ".join(commands), cases=cases)
    return _ZSH + script if shell == "zsh" else script


def _find_commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def _list_options(command: argparse.ArgumentParser) -> list[str]:
    return [name for action in command._actions for name in action.option_strings]

"""`sitl completion SHELL`: prints a script that completes the command line in a shell."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

SHELLS = ("bash", "zsh", "fish")
INSTALL = {
    "bash": "sitl completion bash > ~/.local/share/bash-completion/completions/sitl",
    "zsh": "sitl completion zsh > ~/.zfunc/_sitl   (a folder in $fpath)",
    "fish": "sitl completion fish > ~/.config/fish/completions/sitl.fish",
}


def add_completion(commands: Any) -> None:
    """Add the command to the command line."""
    parser = commands.add_parser(
        "completion",
        help="print a completion script for bash, zsh or fish",
        description="Print a script that completes commands, options and values in a shell.",
        epilog="To install it: " + "; ".join(INSTALL.values()) + ". For this shell only: "
        'eval "$(sitl completion bash)".',
    )
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help="bash, zsh or fish")


def run_completion(arguments: argparse.Namespace) -> int:
    """Print the script of the shell."""
    import shtab

    from sitl.command_line.arguments import build_parser

    parser = build_parser()
    _name_values(parser)
    print(shtab.complete(parser, arguments.shell))
    return 0


def _name_values(parser: argparse.ArgumentParser) -> None:
    """Tell shtab which values are files, folders, or names."""
    import shtab

    from sitl.flights.scenario import scenario_names
    from sitl_bridge.vehicle.files import vehicle_names

    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _name_values(command)
            continue
        values: Any = None
        if action.dest == "scenario":
            values = _names_or_files("scenarios", scenario_names())
        elif action.dest == "vehicle":
            values = _names_or_files("vehicles", vehicle_names())
        elif action.dest == "sources":
            values = shtab.FILE
        elif action.type is Path:
            values = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE
        if values is not None:
            vars(action)["complete"] = values


def _names_or_files(what: str, names: Sequence[str]) -> dict[str, Any]:
    """Completion of shipped names, and of TOML files; in the form that shtab takes."""
    words, function = " ".join(names), f"_sitl_{what}"
    bash = f"""{function}() {{
  compgen -W "{words}" -- "$1"
  compgen -d -- "$1"
  compgen -f -X '!*.toml' -- "$1"
}}"""
    zsh = f"""{function}() {{
  _alternative '{what}:{what}:({words})' 'files:file:_files -g "*.toml"'
}}"""
    return {
        "bash": function,
        "zsh": function,
        "fish": f"(printf '%s\\n' {words}; __fish_complete_path (commandline -ct))",
        "preamble": {"bash": bash, "zsh": zsh},
    }

"""The command line: a section for each command, a row for each option."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

from sitl.command_line.arguments import build_parser
from sitl.reference_pages.tables import page, table


def markdown() -> str:
    """The page."""
    commands = _commands(build_parser())
    assert commands is not None
    summaries = {action.dest: action.help or "" for action in commands._choices_actions}
    overview = table(
        ("command", "what it does"),
        [(f"[`sitl {name}`](#sitl-{name})", summaries[name]) for name in commands.choices],
    )
    about = [
        *("`sitl` alone and `sitl help` list the commands; `sitl help COMMAND` shows one.", ""),
        *("| exit code | meaning |", "|---|---|"),
        *("| 0 | it worked; of a flight: the load settled |", "| 1 | it did not, or a process failed |"),
        *("| 2 | the command line, a file or a description is wrong |", "| 130 | ended by Ctrl-C |"),
    ]
    sections = [
        part for name, command in commands.choices.items() for part in _sections(f"sitl {name}", command)
    ]
    return page("Command line", "the command line's parser", overview, about, *sections)


def _commands(parser: argparse.ArgumentParser) -> Any:
    """The action that holds a parser's commands; None: it has none."""
    return next((a for a in parser._actions if isinstance(a, argparse._SubParsersAction)), None)


def _sections(name: str, parser: argparse.ArgumentParser) -> Iterator[list[str]]:
    """The section of a command, then those of the commands in it."""
    yield _section(name, parser)
    inner = _commands(parser)
    for deeper, command in inner.choices.items() if inner else ():
        yield from _sections(f"{name} {deeper}", command)


def _section(name: str, parser: argparse.ArgumentParser) -> list[str]:
    rows = [(_spelling(action), _meaning(action, parser)) for action in _shown(parser)]
    lines = [f"## {name}", "", parser.description or ""]
    lines += ["", *table(("argument", "meaning"), rows)] if rows else []
    return [*lines, "", parser.epilog] if parser.epilog else lines


def _shown(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:
        if (
            not isinstance(action, argparse._HelpAction | argparse._SubParsersAction)
            and action.help != argparse.SUPPRESS
        ):
            yield action


def _spelling(action: argparse.Action) -> str:
    value = action.metavar or (f"{{{','.join(map(str, action.choices))}}}" if action.choices else "")
    name = value if isinstance(value, str) else " ".join(value)
    if not action.option_strings:
        return f"`{name or action.dest}`"
    takes = action.nargs != 0
    return ", ".join(
        f"`{flag} {name or action.dest.upper()}`" if takes else f"`{flag}`" for flag in action.option_strings
    )


def _meaning(action: argparse.Action, parser: argparse.ArgumentParser) -> str:
    known = {**vars(action), "prog": parser.prog}
    return (action.help or "") % known

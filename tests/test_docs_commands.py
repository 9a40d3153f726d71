"""The page of commands has every command of `mufe`, and names only options that each one has."""

import re

import pytest
import typer

from mufe_fenicsx.cli.main import app
from tests.docs_pages import ROOT

PAGE = ROOT / "docs" / "reference" / "commands.md"
#: Of a row: the command, its purpose, its options.
ROW = re.compile(r"^\| `mufe ([a-z][a-z-]*(?: [a-z][a-z-]*)*).*?` \|(.*?)\|(.*?)\|", re.MULTILINE)


def commands(command, name=""):
    """(name, command) of all that do something."""
    below = getattr(command, "commands", None)
    if not below:
        return [(name.strip(), command)]
    return [pair for word, c in below.items() for pair in commands(c, f"{name} {word}")]


COMMANDS = dict(commands(typer.main.get_command(app)))
ROWS = {name: options for name, _, options in ROW.findall(PAGE.read_text(encoding="utf-8"))}


def test_all_commands_are_there_and_no_others():
    assert sorted(ROWS) == sorted(COMMANDS)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_a_command_has_the_options_that_its_row_names(name):
    known = {option for p in COMMANDS[name].params for option in p.opts}
    assert set(re.findall(r"`(--[a-z-]+)`", ROWS[name])) <= known

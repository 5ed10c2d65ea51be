"""Help is for people: whole sentences, no types of Python, `-h` as well, completion."""

import re
import subprocess
import sys

import pytest

from observer_rt.cli.app import app

COMMANDS = [command.callback.__name__ for command in app.registered_commands if command.callback]


def said(*arguments: str) -> str:
    """What the program prints to these arguments, on a narrow terminal."""
    done = subprocess.run(
        [sys.executable, "-m", "observer_rt", *arguments], capture_output=True, text=True, check=True
    )
    return done.stdout


def test_the_list_of_commands_cuts_no_sentence() -> None:
    listed = said("-h").split("\nCommands:\n")[1]
    assert re.findall(r"^  (\w+)", listed, re.MULTILINE) == COMMANDS
    sentences = re.split(r"^  \w+ +", listed, flags=re.MULTILINE)[1:]
    assert all(sentence.rstrip().endswith(".") and "..." not in sentence for sentence in sentences)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_names_no_types_and_has_an_example(command: str) -> None:
    text = said(command, "-h")
    assert text == said(command, "--help")
    assert not re.search(r"<\w+(\[\w+\])?( range)?>", text)
    assert f"Example: observer-rt {command}" in text


def test_completion_can_be_installed() -> None:
    assert "--install-completion" in said("--help")

"""Every command with its arguments and options, as `chamberopt COMMAND --help` shows them."""

import re

from chamberopt.cli.command_line import app


def section() -> str:
    """Return a list of the commands, and a heading for each with what it takes, as Markdown."""
    text = app.generate_docs("markdown")
    text = re.sub(r"^\*\*(\w+)\*\*:$", r"\1:", text, flags=re.MULTILINE)
    text = re.sub(r" \*\[default: False\]\*", "", text)  # a switch that is off
    _, _, listed = text.partition("\nCommands:\n")
    listed, *commands = re.split(r"^(?=## )", listed, flags=re.MULTILINE)
    return "\n".join([listed, *sorted(commands)])

"""Words of the page for keys of files, commands and options of the command line, and choices.

What the page shows of a message is a list of texts, in which a key, option or term is a pair: its
words, and a tip. The tip says what a key is in a file or on the command line, or what a term means.
"""

from __future__ import annotations

import re
from html import escape

from chamberopt.common.key_words import KEY, KINDS, key_in_words
from chamberopt.documents.wording import FILES

Words = list[str | tuple[str, str]]

CHOICES = {
    "conformal": "conformal: follows the part",
    "": "none: the part hangs in the air",
    **KINDS,
}
OPTIONS = {
    "target": "what is peened",
    "unit": "the unit of the part",
    "material": "alloy of the part",
    "shot": "balls",
    "shape": "form of the chamber",
    "shop": "what your shop has",
    "intensity": "Almen intensity",
    "coverage": "coverage",
    "ball-mm": "ball diameter in mm",
    "pose": "pose of the part",
    "calibration": "calibration of the machine",
    "no-pilot": "the choice not to simulate",
}
# What the page has in the place of a command, or what the command is for where the page lacks it.
COMMANDS = {
    "chamberopt simulate": "Simulate, in the tab Run",
    "simulate --tolerances": "a simulation with tolerances, in a terminal",
    "chamberopt run": "Search, in the tab Run",
    "chamberopt check": "what this page says at its right",
    "chamberopt check --pilot": "a check with pilot runs, in a terminal",
    "chamberopt calibrate": "a calibration of the machine, in a terminal",
    "chamberopt materials": "the catalogue of materials",
    "chamberopt shot": "the catalogue of balls",
    "chamberopt inspect": "a window in 3D, from a terminal",
    "chamberopt strip": "a virtual Almen strip, in a terminal",
    "chamberopt export": "an export, in a terminal",
    "chamberopt new": "the page of parts",
    "chamberopt shop --example": "the example of a shop's file",
    "simulate it with --tolerances": "simulate it with tolerances, in a terminal",
    "set part.target.reachable = true": "leave out of it, in the file, what no ball can touch",
}
# Parts of messages that only a terminal needs: the page leaves them out.
_TERMINAL = re.compile(
    "; press Ctrl-C again to stop now|; --no-ranges leaves them out"
    "|(?<= of the target is): chamberopt strip --distance-mm [0-9]+"
    "|(?m:^to resume: .*\\n?)"
    "|; to resume it: .*|; --tolerances simulates them too"
    r"| \(docs/[\w/]+\.md(?:#[\w-]+)?\)|(?:, or|;) use --at ZONE(?: with a zone of the part)?"
)
# At the end of a command that has more to say.
_MORE_NOTES = re.compile(r"(?<=more note)(s?): --verbose shows all")
# Sizes of strips, as options of a command.
_DISC, _STRIP = re.compile(r"--disc-mm ([\d.]+)"), re.compile(r"--size-mm ([\d.]+) ([\d.]+)")
# Surfaces of a part, as options of a command.
_TARGETS = re.compile(r'--target ("[^"]+"(?: --target "[^"]+")*)')
# Terms that not every reader knows, and what they mean (docs/reference/glossary.md).
TERMS = {
    "uniform coverage": "mean coverage of the target less its standard deviation: high where the "
    "coverage is high and the same everywhere",
    "C0": "rebound speed over impact speed of a hit so slow that the metal does not yield",
    "v0": "impact speed from which on the metal yields: above it a ball leaves a dent and rebounds "
    "less",
    "slow end of friction": "friction is known within a range only; at this end of it the balls "
    "are slowest, so that the time is the longest",
    "not resolved": "too few dents were simulated to tell: simulate longer",
    "replicas": "simulations of the same chamber, each from a random start of its own; how they "
    "differ gives the interval ±",
    "within a factor of": "0.1 within a factor of 2 is from 0.05 to 0.2",
    "restitution": "rebound speed over impact speed; less above the speed that is named, from "
    "which on the metal yields",
    "most_even": "the study of the most even coverage, the largest mean less its spread",
}
_GUIDE = r"docs/[\w/]+\.md(?:#[\w-]+)?"
_COMMAND = "|".join(sorted(map(re.escape, COMMANDS), key=len, reverse=True))
_KEY = re.compile(rf"{_GUIDE}|(?:{_COMMAND})(?![\w-])|{KEY}|--(?:{'|'.join(OPTIONS)})(?![\w-])")
_TERM = re.compile(rf"(?<![\w./])(?:{'|'.join(map(re.escape, TERMS))})(?![\w./])")
_PLACE = re.compile(r"(?m)^\S*\.toml:\d+: ")  # of a line in a file, which the page does not show


def on_page(text: str, known: set[str] | None = None) -> Words:
    """Return a message of the program with its keys and options in the words of the page.

    A command is named by what the page has in its place; how to go on in a terminal is left out. A
    term has its meaning where it stands
    first.

    Args:
        known: terms that have had their meaning before; those of the message are added.

    >>> on_page("raise chamber.height_mm")
    ['raise ', ('height of the chamber', 'chamber.height_mm')]
    >>> on_page('all of them: --target "face 2" --target "face 3"')
    ['all of them: "face 2" and "face 3"']
    """
    made: Words = []
    at, text = 0, _TERMINAL.sub("", _PLACE.sub("", text))
    text = _MORE_NOTES.sub(r"\1, below its figures in the tab Results", text)
    text = _STRIP.sub(r"a strip of \1 x \2 mm", _DISC.sub(r"a disc of \1 mm", text))
    text = _TARGETS.sub(lambda found: found[1].replace(" --target ", " and "), text)
    known = set() if known is None else known
    for match in sorted((*_KEY.finditer(text), *_TERM.finditer(text)), key=lambda one: one.start()):
        found = match[0]
        if match.start() < at or found in known:
            continue
        if found in TERMS:
            known.add(found)
            made += [text[at : match.start()]] * (match.start() > at)
            made.append((found, TERMS[found]))
            at = match.end()
            continue
        if found.lower().endswith(FILES):
            continue
        words = COMMANDS.get(found) or OPTIONS.get(found[2:]) or key_in_words(found)
        words = "guide" if found.startswith("docs/") else words
        made += [text[at : match.start()]] * (match.start() > at)
        made.append((words, found))
        at = match.end()
    return [*made, *[text[at:]] * (at < len(text))]


_LINE = re.compile(r"(?m)^(?:.*\.toml:\d+: )?(?:vary\.|--)?([a-z][\w.-]*): (.+)$")


def at_keys(text: str) -> dict[str, Words]:
    """Return what a message says of each key or option with which one of its lines begins.

    >>> at_keys("a/design.toml:9: chamber.height_mm: given -5; allowed: from 2 mm")
    {'chamber.height_mm': ['given -5; allowed: from 2 mm']}
    """
    return {key: on_page(said) for key, said in _LINE.findall(text)}


_SAID = re.compile(r"(<(?:p|td|th|dt|dd|li|caption)\b[^>]*>)([^<]+)")


def explained(html: str) -> str:
    """Return HTML whose sentences are in the words of the page, as of `on_page`.

    Keys, commands and terms have what they are as a tip, a term where it stands first.
    """
    known: set[str] = set()

    def told(one: str | tuple[str, str]) -> str:
        if isinstance(one, str):
            return one
        return f'<abbr title="{escape(one[1])}">{one[0]}</abbr>'

    return _SAID.sub(lambda said: said[1] + "".join(map(told, on_page(said[2], known))), html)


# How `new` names balls and an amplitude that would suit (chamber/propose), in mm and µm.
_BALLS = re.compile(r"([\d.]+) mm would suit|--ball-mm ([\d.]+) takes|balls of about ([\d.]+) mm")
_AMPLITUDE = re.compile(r"an amplitude of about ([\d.]+) µm zero-to-peak")


def balls_named(text: str) -> list[float]:
    """Return the diameters [mm] of balls that a matter says would suit.

    >>> balls_named("MANY BALLS, to be dosed and sorted: 0.7 mm would suit 80%")
    [0.7]
    """
    return list(dict.fromkeys(float(next(filter(None, one))) for one in _BALLS.findall(text)))


def amplitudes_named(text: str) -> list[float]:
    """Return the amplitudes [µm], zero-to-peak, that a matter says would suit."""
    return list(dict.fromkeys(map(float, _AMPLITUDE.findall(text))))


# How `new` names what the shot meets beside the target (chamber/propose/proposed_mask.py).
_MET = re.compile(r"the shot also meets (.+? \([^()]*\)); ")
_MET_NAME = re.compile(r"(?:the rest of )?(.+?) \([^()]*\)(?:, |$)")


def names_met(text: str) -> list[str]:
    """Return the surfaces that a matter says are met beside the target; [] if others are not named.

    >>> names_met("NOT MASKED: the shot also meets WEB (80 mm²), RIM (3 mm² of it); what")
    ['WEB', 'RIM']
    """
    found = _MET.search(text)
    return _MET_NAME.findall(found[1]) if found else []


def choices(name: str, allowed: tuple[str, ...] | list[str]) -> list[tuple[str, str]]:
    """Return each text that is allowed for a name of a design, with its words on the page."""
    words = CHOICES | {"": "none: nothing is covered"} if name == "mask.kind" else CHOICES
    return [(one, words.get(one, one.replace("_", " "))) for one in allowed]

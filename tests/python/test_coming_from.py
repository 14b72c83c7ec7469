"""docs/howto/coming-from.md: its formulas against integrated contacts, its scenes against theory, states of others."""

from __future__ import annotations

import bz2
import math
import re
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import haff
from conftest import ROOT
from haff import analysis, theory
from haff.files import programs

PAGE = ROOT / "docs" / "howto" / "coming-from.md"
SCRIPT = ROOT / "examples" / "foreign_states.py"
SOLID = 2 / 5


def scene(title: str) -> str:
    found = re.search(rf'```toml title="{title}"\n(.*?)```', PAGE.read_text(), flags=re.DOTALL)
    assert found, f"{title} is not on the page"
    return found[1]


@pytest.fixture(scope="module")
def contact():
    """The function `contact` of the page."""
    code = re.search(r"```python\n(from math import.*?def contact.*?)```", PAGE.read_text(), flags=re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(code[1], "coming-from.md", "exec"), names)
    return names["contact"]


@pytest.fixture(scope="module")
def runs(command, tmp_path_factory):
    """Runs a scene of the page; each once."""
    folder, done = tmp_path_factory.mktemp("coming_from"), {}

    def run(title, **settings):
        if title not in done:
            (folder / title).write_text(scene(title))
            done[title] = command.run(folder / title, **settings)
        return done[title]

    return run


def impact(force, mass, speed, scale, limit=False):
    """Duration and restitution of a normal impact with `force(overlap, speed)`, by integration.

    It ends where the overlap does, with `limit` where the force does.
    """
    end = (lambda _, y: force(y[0], y[1])) if limit else (lambda _, y: y[0])
    end.terminal, end.direction = True, -1
    settings = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-18, "max_step": scale / 200}
    path = solve_ivp(lambda _, y: [y[1], -force(*y) / mass], (0, 2 * scale), [0.0, speed], events=end, **settings)
    return path.t_events[0][0], -path.y_events[0][0][1] / speed


# Restitution of linear springs


@pytest.mark.parametrize("mass", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("gamma", [0.0, 50.0, 400.0])
def test_restitution_of_a_spring_and_dashpot_is_that_of_the_integrated_impact(contact, mass, gamma):
    k = 2e5
    duration, e, _ = contact(k, gamma, mass)
    for speed in (0.01, 7.0):
        found = impact(lambda x, v: k * x + mass * gamma * v, mass, speed, duration)
        np.testing.assert_allclose(found, (duration, e), rtol=1e-8)


def test_numbers_on_the_page_are_those_of_the_function(contact):
    text = PAGE.read_text()
    for mass in (0.5, 1.0):
        duration, e, beta = contact(200_000, 50, mass, gamma_t=25)
        shown = f"{duration:.5f}, {e:.5f}, {beta:.3f}".replace("-", "−")
        assert f"# {shown}" in text, shown
        assert f"restitution = {e:.5f}" in scene("lammps.toml")


def test_an_end_at_vanishing_force_is_the_factor_of_the_page(contact):
    k, gamma, mass = 2e5, 150.0, 0.5
    duration, e, _ = contact(k, gamma, mass)
    omega = math.pi / duration
    factor = 1 - math.atan2(gamma * omega, omega**2 - gamma**2 / 4) / math.pi
    found = impact(lambda x, v: k * x + mass * gamma * v, mass, 1.0, duration, limit=True)
    np.testing.assert_allclose(found, (factor * duration, e**factor), rtol=1e-8)


@pytest.mark.parametrize("e", [0.95, 0.88, 0.5])
def test_walls_have_the_restitution_of_the_page(e):
    """The spring and dashpot that give e between equal grains (m_eff = m/2), at a wall (m_eff = m)."""
    mass, duration, log = 1.3, 0.005, math.log(e)
    k = 0.5 * mass * ((math.pi / duration) ** 2 + (log / duration) ** 2)
    damping = -mass / duration * log  # [mass/time]
    np.testing.assert_allclose(impact(lambda x, v: k * x + damping * v, mass / 2, 1.0, duration)[1], e, rtol=1e-8)
    mercury = impact(lambda x, v: k * x + damping * v, mass, 1.0, 2 * duration)[1]
    np.testing.assert_allclose(mercury, math.exp(math.pi * log / math.sqrt(2 * math.pi**2 + log**2)), rtol=1e-8)
    lammps = impact(lambda x, v: k * x + mass * (2 * damping / mass) * v, mass, 1.0, 2 * duration)[1]
    expected = math.exp(math.sqrt(2) * math.pi * log / math.sqrt(math.pi**2 - log**2))
    np.testing.assert_allclose(lammps, expected, rtol=1e-8)


# Restitution of Hertzian springs

STIFFNESS, RADIUS, MASS = 1e6, 0.25, 0.5


def hertz(damping):
    """The force of `hertz` with a damping coefficient [mass/time] that depends on the stiffness K_n a."""
    return lambda x, v: STIFFNESS * math.sqrt(RADIUS) * max(x, 0) ** 1.5 + damping(math.sqrt(RADIUS * max(x, 0))) * v


@pytest.mark.parametrize("e", [0.9, 0.5])
def test_coeff_restitution_of_hertz_is_e_at_every_speed(e):
    log = math.log(e)
    factor = -2 * math.sqrt(5 / 6) * log / math.hypot(math.pi, log)
    force = hertz(lambda a: factor * math.sqrt(1.5 * STIFFNESS * a * MASS))
    for speed in (0.1, 10.0):
        # The root of the overlap limits the order of the integration at both ends.
        assert impact(force, MASS, speed, 0.02)[1] == pytest.approx(e, rel=1e-8)


def test_tsuji_without_the_root_of_two_gives_0_928_for_0_9():
    e = 0.9
    alpha = 1.2728 - 4.2783 * e + 11.087 * e**2 - 22.348 * e**3 + 27.467 * e**4 - 18.022 * e**5 + 4.8218 * e**6
    found = [
        impact(hertz(lambda a, f=f: f * alpha * math.sqrt(MASS * STIFFNESS * a)), MASS, 1.0, 0.02)[1]
        for f in (1, math.sqrt(2))
    ]
    # The polynomial itself is a fit, good to some 1e-4.
    assert found == pytest.approx([0.928, 0.9], abs=5e-4)
    assert "0.928 for 0.9" in PAGE.read_text()


@pytest.mark.parametrize("gamma", [50.0, 500.0, 800.0])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_hertz_history_is_the_viscoelastic_law_with_the_coefficient_of_the_page(gamma, speed):
    assert "coefficient = γ_n R_eff^(1/5) (m_eff/K_n)^(3/5)" in PAGE.read_text()
    coefficient = gamma * RADIUS**0.2 * (MASS / STIFFNESS) ** 0.6
    e = float(theory.viscoelastic_restitution_pade(speed, coefficient))
    found = impact(hertz(lambda a: MASS * gamma * a), MASS, speed, 0.03, limit=True)[1]
    assert e > 0.88
    assert found == pytest.approx(e, abs=1e-4), f"integrated {found:.6f}, law of haff {e:.6f}"


# Tangential forces


def oblique(k, gamma, mass, k_t, gamma_t, slip, speed, friction=math.inf):
    """Slip and tangential impulse after an impact of two equal solid spheres, bodies and spins integrated on their own.

    The normal stays where it is, as for hard contacts. Sliding is Coulomb's, and does not move the spring.
    """
    m, inertia = 2 * mass, SOLID * 2 * mass  # of each sphere, radius 1
    duration = math.pi / math.sqrt(k / mass - gamma**2 / 4)

    def rates(_, y):
        overlap, approach, spring, u1, u2, w1, w2, _ = y
        at_contact = (u1 - u2) + (w1 + w2)
        normal = k * overlap + mass * gamma * approach
        tangential = -k_t * spring - mass * gamma_t * at_contact
        tangential = max(-friction * abs(normal), min(friction * abs(normal), tangential))
        return [
            approach,
            -normal / mass,
            at_contact,
            tangential / m,
            -tangential / m,
            tangential / inertia,
            tangential / inertia,
            tangential,
        ]

    start = [0.0, speed, 0.0, slip / 2, -slip / 2, 0.0, 0.0, 0.0]
    path = solve_ivp(rates, (0, duration), start, method="DOP853", rtol=1e-12, atol=1e-15, max_step=duration / 500)
    u1, u2, w1, w2, impulse = path.y[3:, -1]
    return (u1 - u2) + (w1 + w2), impulse, -path.y[1, -1]


@pytest.mark.parametrize(
    ("k_t", "gamma_t"), [(0.0, 25.0), (0.0, 0.0), (2 / 7 * 2e5, 0.0), (2 / 7 * 2e5, 25.0), (1e5, 80.0), (500.0, 400.0)]
)
def test_beta_of_a_contact_that_does_not_slide_is_that_of_two_integrated_spheres(contact, k_t, gamma_t):
    beta = contact(2e5, 50.0, 0.5, k_t, gamma_t)[2]
    after, _, _ = oblique(2e5, 50.0, 0.5, k_t, gamma_t, slip=0.7, speed=1.0)
    assert after == pytest.approx(-beta * 0.7, abs=1e-8)


def two_spheres(e, beta, friction, slip, speed):
    """Tangential velocities and spins after one impact of equal spheres of radius 1 in haff."""
    live = haff.Simulation(
        {
            "domain": {"boundary": ["open", "open", "open"]},
            "particle": [
                {"position": [0, 0, 0], "velocity": [speed, slip / 2, 0], "radius": 1.0, "mass": 1.0},
                {"position": [2, 0, 0], "velocity": [0, -slip / 2, 0], "radius": 1.0, "mass": 1.0},
            ],
            "contact": {"restitution": e, "tangential_restitution": beta}
            | ({} if friction == math.inf else {"friction": friction}),
            "run": {"until": 1.0},
        }
    )
    live.advance(0.01)
    return live.velocities, live.angular_velocities


@pytest.mark.parametrize(("friction", "slip", "relative"), [(math.inf, 0.7, 1e-8), (0.05, 7.0, 0.01)])
def test_an_oblique_impact_in_haff_is_that_of_the_soft_spheres(contact, friction, slip, relative):
    """Both limits of Coulomb's law: a contact that does not slide, and one that slides throughout."""
    k, gamma, gamma_t, speed = 2e5, 50.0, 25.0, 1.0
    _, e, beta = contact(k, gamma, 0.5, gamma_t=gamma_t)
    _, impulse, separation = oblique(k, gamma, 0.5, 0.0, gamma_t, slip, speed, friction)
    velocities, spins = two_spheres(e, beta, friction, slip, speed)
    assert velocities[1, 0] - velocities[0, 0] == pytest.approx(separation, abs=1e-8)
    found = velocities[0, 1] - slip / 2
    # The soft contact that slides rubs also at its end, where its force attracts: some tenths of a per cent.
    assert found == pytest.approx(impulse, rel=relative), (found, impulse)
    assert np.allclose(spins[:, 2], spins[0, 2]) and abs(spins[0, 2]) == pytest.approx(abs(found) / SOLID)


def truncated(k, gamma, mass, k_t, gamma_t, slip, friction, steps=4000):
    """Tangential impulse of a contact as `pair_style gran/hooke/history` has it, at normal speed 1.

    The spring is cut so that the whole tangential force is at most μ times the normal one.
    """
    h = math.pi / math.sqrt(k / mass - gamma**2 / 4) / steps
    overlap, approach, spring, impulse = 0.0, 1.0, 0.0, 0.0
    for _ in range(steps):
        normal = k * overlap + mass * gamma * approach
        spring += slip * h
        force, limit = -k_t * spring - mass * gamma_t * slip, friction * abs(normal)
        if abs(force) > limit:
            force = math.copysign(limit, force)
            spring = -(force + mass * gamma_t * slip) / k_t if k_t > 0 else 0.0
        approach -= normal / mass * h
        overlap += approach * h
        slip += force * (1 + 1 / SOLID) / mass * h
        impulse += force * h
    return impulse


@pytest.mark.parametrize(("k_t", "gamma_t", "largest"), [(0.0, 25.0, 0.185), (4e5 / 7, 0.0, 0.05)])
@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_contacts_that_stick_and_slide_differ_from_haff_as_the_page_says(contact, k_t, gamma_t, largest, friction):
    """The difference is largest where both of haff's impulses are equal, and the same at every μ."""
    assert "by up to 5 % with a spring" in PAGE.read_text() and "by up to 19 % without one" in PAGE.read_text()
    _, e, beta = contact(2e5, 50.0, 0.5, k_t, gamma_t)
    equal = friction * (1 + e) * (1 + 1 / SOLID) / (1 + beta)  # slip [speed of approach]
    found = {}
    for part in (0.05, 0.8, 1.0, 1.2, 20.0):
        hard = min(part, 1.0) * friction * (1 + e) * 0.5
        found[part] = abs(truncated(2e5, 50.0, 0.5, k_t, gamma_t, part * equal, friction) / -hard - 1)
    # 4000 steps: some 1e-3.
    assert found[1.0] == pytest.approx(largest, abs=3e-3) and max(found.values()) == found[1.0], found
    assert max(found[0.05], found[20.0]) < 0.01, found


# Scenes


@pytest.mark.physics
def test_the_shaken_gas_loses_at_grains_and_floor_what_lammps_coefficients_say(runs, contact):
    with runs("lammps.toml", output__events=True).open() as run:
        events = run.events.to_pandas(["kind", "approach_speed", "energy_loss"])
        for kind, mass in (("collision", 0.5), ("wall", 1.0)):
            rows = events[events["kind"] == kind]
            assert len(rows) > 1000
            e = np.sqrt(1 - rows["energy_loss"] / (0.5 * mass * rows["approach_speed"] ** 2))
            # The page prints five digits; very slow impacts have rounding of their own.
            np.testing.assert_allclose(e, contact(200_000, 50, mass)[1], rtol=1e-5)
        table = run.observables
        assert table["ledger_residual"].abs().max() < 1e-12
        late = table[table["time"] >= 20]
        given, taken = np.ptp(late["wall_work"]), np.ptp(late["dissipated_energy"])
        stored = np.ptp(late["kinetic_energy"] + late["potential_energy"])
        assert abs(given - taken) <= stored < 0.1 * given, (given, taken, stored)


@pytest.mark.physics
def test_the_floor_of_the_shaken_gas_moves_as_wiggle_does(tmp_path):
    """`wiggle z A period`: lo + A − A cos ωt with lo = 0, A = 0.1 and period 0.2: it reaches 0.15 at ωt = 2π/3."""
    (tmp_path / "scene.toml").write_text(scene("lammps.toml"))
    settings = haff.load_scene(tmp_path / "scene.toml")
    for name in ("species", "initial"):
        del settings[name]
    del settings["domain"]["gravity"]
    settings["particle"] = [{"position": [5, 5, 0.65], "radius": 0.5, "mass": 1.0}]
    haff.run(settings, run__until=0.1, output__events=True, file=tmp_path / "floor.h5")
    with haff.open(tmp_path / "floor.h5") as run:
        assert run.events["time"][0] == pytest.approx(0.2 / 3, abs=1e-12)


@pytest.mark.physics
def test_the_ball_bounces_as_mercurys_spring_lets_it(runs):
    """Heights and times of the page; bounces of the soft ball, integrated with gravity, tend to the same e."""
    log = math.log(0.88)
    e = math.exp(math.pi * log / math.sqrt(2 * math.pi**2 + log**2))
    with runs("ball.toml", output__events=True).open() as run:
        events = run.events.to_pandas(["time", "kind", "approach_speed"])
        speeds = events[events["kind"] == "wall"]["approach_speed"].to_numpy()
        np.testing.assert_allclose(speeds[1:20] / speeds[:19], e, rtol=1e-6)
        drop = math.sqrt(2 * 0.495 / 9.81)
        assert events["time"].iloc[-1] == pytest.approx(drop * (1 + e) / (1 - e), rel=1e-5)
        assert f"{drop * (1 + e) / (1 - e):.2f} s" in PAGE.read_text() and f"{e**2:.3f} as high" in PAGE.read_text()
    mass = 2500 * 4 / 3 * math.pi * 0.005**3
    tc = 0.005
    k, damping = 0.5 * mass * (math.pi**2 + log**2) / tc**2, -mass / tc * log
    speed = math.sqrt(2 * 9.81 * 0.495)
    soft = impact(lambda x, v: k * x + damping * v - mass * 9.81, mass, speed, 0.01)[1]
    # Gravity during the contact: of the order of g t_c/v.
    assert soft == pytest.approx(e, abs=9.81 * 0.0071 / speed)


@pytest.mark.physics
@pytest.mark.parametrize("title", ["dynamo.toml", "hoomd.toml"])
def test_fluids_have_pressure_and_collision_rate_of_theory(runs, title):
    with runs(title).open() as run:
        table = run.observables
        late = table[table["time"] > 3][:-1]  # the last sample is a short one
        eta, n = run.summary["packing_fraction"], len(run) / run.box.volume
        g0 = theory.contact_value(eta, 3, "klm")
        # KLM is good to 4e-5; finite N shifts both by about 1/N.
        for name, values, expected in (
            ("Z", late["pressure"] / (n * late["temperature"]), float(theory.kolafa_labik_malijevsky(eta))),
            ("mean free time", late["mean_free_time"], float(theory.mean_free_time(n, 1.0, 1.0, 1.0, g0))),
        ):
            found = analysis.block_average(values, 20)
            z = found.z(expected, (4e-5 + 1 / len(run)) * expected)
            assert found.error < 3e-3 * expected, f"{name}: error {found.error:.2g}"
            assert abs(z) < 4, (
                f"{title}, {name} = {found.mean:.5f} ± {found.error:.2g}, theory {expected:.5f}, z = {z:.2f}"
            )
        if title == "dynamo.toml":
            # `hardsphere_test` of DynamO, which allows 1 %.
            assert analysis.block_average(late["mean_free_time"], 20).mean == pytest.approx(0.13031, rel=0.01)
        else:
            shown = float(theory.kolafa_labik_malijevsky(eta)) * n
            assert f"equation of state {shown:.3f}" in PAGE.read_text()


def test_the_diameter_of_wca_spheres_is_the_one_of_the_page():
    def boltzmann(r):
        return 1 - math.exp(-(4 * (r**-12 - r**-6) + 1))

    diameter = 0.5 + quad(boltzmann, 0.5, 2 ** (1 / 6))[0]
    assert f"{diameter:.4f} σ for kT = ε" in PAGE.read_text()


# States

SOFT = """ITEM: TIMESTEP
0
ITEM: NUMBER OF ATOMS
1
ITEM: BOX BOUNDS pp pp ff
0 1
0 1
0 1
ITEM: ATOMS id type x y z vx vy vz radius mass
1 1 0 0 0 0 0 0 9 1
ITEM: TIMESTEP
100
ITEM: NUMBER OF ATOMS
4
ITEM: BOX BOUNDS pp pp ff
-5 5
-5 5
2 12
ITEM: ATOMS id type x y z vx vy vz radius mass
4 2 0 0 8.5 0.5 0 0 1 8
2 1 4.75 0 4 0 1 0 0.5 1
1 1 -4.26 0 4 0 0 1 0.5 1
3 1 0 5.5 4 0 0 0 0.5 1
"""
"""Two frames; in the second atoms 1 and 2 overlap by a hundredth across the x face, and atom 3 is beyond its box."""


def begin(folder, printed, csv):
    """A live simulation from a CSV and the sections that the script has printed."""
    text = printed.replace("# mass or density = ?", "density = 1.0")
    more = f'[initial]\npositions = {{ file = "{csv}" }}\n\n[run]\nuntil = 1.0\n'
    (folder / "scene.toml").write_text(f"{text}\n\n{more}")
    return haff.Simulation(haff.load_scene(folder / "scene.toml"))


def convert(*arguments, check=True):
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=check)


def test_a_scene_starts_from_a_dump_of_lammps(tmp_path):
    (tmp_path / "dump.lammpstrj").write_text(SOFT)
    printed = convert(tmp_path / "dump.lammpstrj", tmp_path / "start.csv").stdout
    assert "# radii times 0.99" in printed
    live = begin(tmp_path, printed, tmp_path / "start.csv")
    np.testing.assert_allclose(live.positions, [[0.74, 5, 2], [9.75, 5, 2], [5, 0.5, 2], [5, 5, 6.5]], atol=1e-14)
    np.testing.assert_array_equal(live.velocities, [[0, 0, 1], [0, 1, 0], [0, 0, 0], [0.5, 0, 0]])
    np.testing.assert_allclose(live.radii, [0.495, 0.495, 0.495, 0.99], rtol=1e-11)
    np.testing.assert_array_equal(live.masses, [1, 1, 1, 8])
    live.advance(0.01)


@pytest.mark.long
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("xx", "xy xz yz xx", "the box is tilted, xy xz yz ="),
        ("radius", "size", "lacks radius or diameter; the columns are id, type"),
        (" y ", " angle ", "lacks positions x, y, z"),
        ("ITEM: TIMESTEP", "TIMESTEP", "no dump of LAMMPS|neither a dump nor a data file"),
    ],
)
def test_a_dump_without_what_a_state_needs_is_refused(tmp_path, old, new, message):
    text = SOFT.replace(old, new)
    if old == "xx":
        text = SOFT.replace("pp pp ff", "xy xz yz pp pp ff").replace("-5 5\n", "-5 5 0.5\n").replace("2 12", "2 12 0")
    (tmp_path / "dump").write_text(text)
    with pytest.raises(ValueError, match=message):
        programs.read(tmp_path / "dump")
    failed = convert(tmp_path / "dump", tmp_path / "start.csv", check=False)
    assert failed.returncode == 1 and re.search(message, failed.stderr) and "Traceback" not in failed.stderr
    assert failed.stderr.count(str(tmp_path / "dump")) == 1


@pytest.mark.long
@pytest.mark.parametrize("form", ["u", "s", "su", "diameter", "no velocities", "few columns", "not tilted"])
def test_a_dump_gives_the_same_state_in_every_form(tmp_path, form):
    """Positions unwrapped or scaled, diameters for radii, a box that could be tilted; only what a state needs."""
    (tmp_path / "plain").write_text(SOFT)
    expected = programs.read(tmp_path / "plain")
    lines = SOFT.splitlines()
    rows = np.array([line.split() for line in lines[-4:]], float)
    names, keep = "id type x y z vx vy vz radius mass".split(), list(range(10))
    if form in ("s", "su"):
        rows[:, 2:5] = (rows[:, 2:5] - [-5, -5, 2]) / 10
    if form in ("u", "s", "su"):
        names[2:5] = [axis + form for axis in "xyz"]
    elif form == "diameter":
        rows[:, 8], names[8] = 2 * rows[:, 8], "diameter"
    elif form == "no velocities":
        keep = [0, 1, 2, 3, 4, 8, 9]
    elif form == "few columns":
        keep = [2, 3, 4, 8]
    head = "\n".join(lines[-13:-5])
    if form == "not tilted":
        head = head.replace("pp pp ff", "xy xz yz pp pp ff").replace("-5 5", "-5 5 0").replace("2 12", "2 12 0")
    atoms = [" ".join(repr(float(x)) for x in row[keep]) for row in rows]
    (tmp_path / "dump").write_text("\n".join([head, f"ITEM: ATOMS {' '.join(names[k] for k in keep)}", *atoms]))
    state = programs.read(tmp_path / "dump")
    np.testing.assert_array_equal(state.size, expected.size)
    np.testing.assert_array_equal(state.periodic, expected.periodic)
    reference = expected.table
    if form == "few columns":
        # One species, in the order of the file.
        reference = reference.set_index("id").loc[[4, 2, 1, 3]].reset_index().assign(species=1, id=[0, 1, 2, 3])
    missing = {"no velocities": ["vx", "vy", "vz"], "few columns": ["vx", "vy", "vz", "mass"]}.get(form, [])
    reference = reference.drop(columns=missing)
    assert set(state.table) == set(reference)
    reference = reference[list(state.table)]
    np.testing.assert_allclose(state.table, reference, rtol=1e-15, atol=4e-15)
    if form == "no velocities":
        printed = convert(tmp_path / "dump", tmp_path / "start.csv").stdout
        assert "# initial.temperature = ?: the file has no velocities" in printed
        with pytest.raises(haff.SceneError, match=r"the file has no velocities: give initial\.temperature"):
            begin(tmp_path, printed, tmp_path / "start.csv")


@pytest.mark.long
def test_a_scene_starts_from_a_data_file_of_lammps(tmp_path):
    """One that haff has written: there and back again."""
    live = {
        "domain": {"size": [8, 9, 10]},
        "species": [{"name": "a", "count": 20, "radius": 0.5, "mass": 2.0}],
        "initial": {"positions": "random"},
        "run": {"until": 0.5},
    }
    haff.run(live, file=tmp_path / "run.h5")
    convert(tmp_path / "run.h5", tmp_path / "start.data")
    printed = convert(tmp_path / "start.data", tmp_path / "start.csv").stdout
    assert "# boundary: not in the file; LAMMPS takes periodic ones by default" in printed
    back = begin(tmp_path, printed, tmp_path / "start.csv")
    with haff.open(tmp_path / "run.h5") as run:
        frame = run.frames[-1]
        np.testing.assert_array_equal(back.positions, frame.position)
        np.testing.assert_array_equal(back.velocities, frame.velocity)
        np.testing.assert_allclose(back.masses, run.mass, rtol=1e-14)
    text = (tmp_path / "start.data").read_text()
    for old, new, message in [
        ("Atoms # sphere", "Atoms # atomic", "needs Atoms # sphere, .*; it has Atoms # atomic"),
        ("Atoms # sphere", "Atoms", "it has Atoms without a style"),
        ("zlo zhi", "zlo zhi\n0.5 0 0 xy xz yz", "the box is tilted, xy xz yz"),
    ]:
        (tmp_path / "other.lmp").write_text(text.replace(old, new))
        with pytest.raises(ValueError, match=message):
            programs.read(tmp_path / "other.lmp")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("dump.txt", SOFT, r"it is a dump of LAMMPS: give its name the ending \.lammpstrj"),
        (
            "grains",
            "grains\n\n5 atoms\n\n0 1 xlo xhi\n",
            r"it is a data file of LAMMPS: give its name the ending \.data",
        ),
        ("Chute.1", "1 0 0 0 0 1 1 1\n", r"it is a file of MercuryDPM: give its name the ending \.data"),
        ("places.txt", "0.5 0.5 0.5\n", "write a table of numbers as .csv, with a line of names first: x,y,z"),
    ],
)
def test_files_with_unknown_endings_say_what_is_read(command, tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    start = {
        "domain": {"size": [8, 9, 10]},
        "species": [{"name": "a", "count": 20, "radius": 0.5, "mass": 2.0}],
        "initial": {"positions": {"file": str(tmp_path / name)}},
        "run": {"until": 0.5},
    }
    with pytest.raises(haff.FileError, match=message):
        haff.Simulation(start)
    failed = command("check", haff.save_scene(start, tmp_path / "scene.toml"), check=False)
    assert failed.returncode == 4 and re.search(message, failed.stderr), failed.stderr


@pytest.mark.long
@pytest.mark.parametrize("ending", ["lammpstrj", "dump"])
def test_a_scene_starts_from_a_dump_directly(command, tmp_path, ending):
    dump = """ITEM: TIMESTEP
{step}
ITEM: NUMBER OF ATOMS
3
ITEM: BOX BOUNDS pp pp pp
-5 5
-4 4
0 6
ITEM: ATOMS id type x y z vx vy vz radius mass
3 2 1 1 {z} 0 0 1 0.25 0.5
1 1 -4 -3 1 0.5 0 0 0.5 2
2 1 0 0 3 0 -1 0 0.5 2
"""
    path = tmp_path / f"grains.{ending}"
    path.write_text(dump.format(step=0, z=2) + dump.format(step=10, z=5))
    start = {
        "domain": {"size": [10, 8, 6]},
        "species": [
            {"name": "coarse", "count": 2, "radius": 0.5, "mass": 2.0},
            {"name": "fine", "count": 1, "radius": 0.25, "mass": 0.5},
        ],
        "initial": {"positions": {"file": str(path)}},
        "run": {"until": 1.0},
    }
    live = haff.Simulation(start)
    np.testing.assert_array_equal(live.positions, [[1, 1, 1], [5, 4, 3], [6, 5, 5]])
    np.testing.assert_array_equal(live.velocities, [[0.5, 0, 0], [0, -1, 0], [0, 0, 1]])
    first = haff.Simulation(start | {"initial": {"positions": {"file": str(path), "index": 0}}})
    assert first.positions[2].tolist() == [6, 5, 2]
    command("check", haff.save_scene(start, tmp_path / "scene.toml"))
    with pytest.raises(haff.FileError, match="has 2 frames; there is no frame 2"):
        haff.Simulation(start | {"initial": {"positions": {"file": str(path), "index": 2}}})


@pytest.mark.long
def test_a_scene_starts_from_a_data_file_of_mercury(tmp_path):
    frame = """2 {time} -1 0 0 1 2 3
-0.5 1 1 0.1 0.2 0.3 0.005 0 0 0 0 0 0 0
0.5 1 2.5 0 0 -1 0.004 0 0 0 0 0 9 1
"""
    (tmp_path / "Chute.data").write_text(frame.format(time=0).replace("0.005", "0.9") + frame.format(time=0.5))
    live = begin(tmp_path, convert(tmp_path / "Chute.data", tmp_path / "start.csv").stdout, tmp_path / "start.csv")
    np.testing.assert_array_equal(live.positions, [[0.5, 1, 1], [1.5, 1, 2.5]])
    np.testing.assert_array_equal(live.velocities, [[0.1, 0.2, 0.3], [0, 0, -1]])
    np.testing.assert_array_equal(live.radii, [0.005, 0.004])


@pytest.mark.long
def test_a_scene_starts_from_a_configuration_of_dynamo(tmp_path):
    """In shear: the peculiar velocities stay, though the flow is 0 in the middle of DynamO's box."""
    rate, peculiar = 0.5, np.array([[0.1, 0.2, 0.3], [-0.1, 0.0, 0.0]])
    place = np.array([[-3.0, -2.0, 0.0], [1.0, 3.5, 4.0]])
    velocity = peculiar + rate * place[:, [1]] * [1, 0, 0]
    points = "".join(
        '<Pt ID="{}"><P x="{!r}" y="{!r}" z="{!r}"/><V x="{!r}" y="{!r}" z="{!r}"/></Pt>'.format(
            k, *p.tolist(), *v.tolist()
        )
        for k, (p, v) in enumerate(zip(place, velocity))
    )
    xml = f"""<DynamOconfig version="1.5.0"><Simulation><SimulationSize x="10" y="8" z="12"/>
<BC Type="LE" DXD="1.25" Rate="{rate}"/>
<Interactions><Interaction Type="HardSphere" Diameter="1" Elasticity="0.9" Name="Bulk"/></Interactions>
</Simulation><ParticleData>{points}</ParticleData></DynamOconfig>"""
    (tmp_path / "config.out.xml.bz2").write_bytes(bz2.compress(xml.encode()))
    printed = convert(tmp_path / "config.out.xml.bz2", tmp_path / "start.csv").stdout
    live = begin(tmp_path, printed, tmp_path / "start.csv")
    np.testing.assert_allclose(live.positions - [5, 4, 6], place, atol=1e-14)
    np.testing.assert_allclose(live.velocities - rate * live.positions[:, [1]] * [1, 0, 0], peculiar, atol=1e-14)
    np.testing.assert_array_equal(live.radii, 0.5)
    assert live.box.edges[1].tolist() == [1.25, 8, 0]


def test_a_configuration_of_dynamo_with_two_diameters_is_refused(tmp_path):
    xml = '<c><Interaction Diameter="1"/><Interaction Diameter="0.5"/></c>'
    (tmp_path / "config.xml").write_text(xml)
    with pytest.raises(ValueError, match=r"needs one interaction with a number as Diameter; it has \['1', '0\.5'\]"):
        programs.read(tmp_path / "config.xml")


def test_a_scene_starts_from_a_file_that_hpmc_writes(tmp_path):
    """HOOMD-blue writes type_shapes and neither diameters nor velocities; `temperature` draws those."""
    gsd = pytest.importorskip("gsd.hoomd")
    side = (1000 * math.pi / 6 / 0.4) ** (1 / 3)
    lattice = (np.indices((10, 10, 10)).reshape(3, -1).T + 0.5) * side / 10
    with gsd.open(str(tmp_path / "fluid.gsd"), "w") as file:
        frame = gsd.Frame()
        frame.particles.N, frame.particles.position = 1000, lattice - side / 2
        frame.particles.types, frame.particles.type_shapes = ["A"], [{"type": "Sphere", "diameter": 1.0}]
        frame.configuration.box = [side, side, side, 0, 0, 0]
        file.append(frame)
    text = scene("hoomd.toml").replace("domain = { packing_fraction = 0.4 }\n", "")
    text = text.replace('positions = "random"', f'positions = {{ file = "{tmp_path / "fluid.gsd"}" }}')
    assert "fluid.gsd" in text and "packing" not in text
    (tmp_path / "scene.toml").write_text(text)
    live = haff.Simulation(haff.load_scene(tmp_path / "scene.toml"))
    np.testing.assert_allclose(live.positions, lattice, atol=1e-6 * side)
    assert live.sample()["temperature"] == pytest.approx(1.0)
    live.advance(1.0)


@pytest.mark.long
def test_frames_go_to_a_data_file_of_lammps(tmp_path):
    live = {
        "domain": {"size": [8, 9, 10]},
        "species": [
            {"name": "a", "count": 20, "radius": 0.5, "mass": 2.0},
            {"name": "b", "count": 5, "radius": {"uniform": [0.3, 0.4]}, "density": 1.5},
        ],
        "initial": {"positions": "random", "rotational_temperature": 1.0},
        "contact": {"tangential_restitution": 0.5},
        "run": {"until": 0.5},
    }
    haff.run(live, file=tmp_path / "run.h5")
    convert(tmp_path / "run.h5", tmp_path / "start.data")
    lines = (tmp_path / "start.data").read_text().splitlines()
    assert "25 atoms" in lines and "2 atom types" in lines and "0 9 ylo yhi" in lines
    at, then = lines.index("Atoms # sphere") + 2, lines.index("Velocities") + 2
    atoms, motion = (np.array([line.split() for line in lines[k : k + 25]], float) for k in (at, then))
    with haff.open(tmp_path / "run.h5") as run:
        frame = run.frames[-1]
        np.testing.assert_array_equal(atoms[:, 0], np.arange(1, 26))
        np.testing.assert_array_equal(atoms[:, 1], run.species + 1)
        np.testing.assert_allclose(atoms[:, 3] * math.pi / 6 * atoms[:, 2] ** 3, run.mass, rtol=1e-14)
        np.testing.assert_array_equal(atoms[:, 4:], frame.position)
        np.testing.assert_array_equal(motion[:, 1:], np.column_stack([frame.velocity, frame.angular_velocity]))

"""Jammed packings: where they jam, their contacts, their pressure, and crystals of slow growth."""

from __future__ import annotations

import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import haff

from ..registry import Part
from ..rows import Row, at_most, compare
from ..runs import Context, run

SLOWLY = """
schema = 1
[[species]]
name = "grain"
count = {count}
radius = 0.5
mass = 1.0
[initial]
positions = {{ file = "{start}" }}
temperature = 1.0
[contact]
restitution = 1.0
[growth]
rate = {rate}
temperature = 1.0
until_reduced_pressure = {pressure}
"""
"""Growth that goes on at another rate."""


@dataclass(frozen=True)
class Jammed:
    """What is measured of one packing."""

    packing_fraction: float
    missing: float
    """Part of the contacts of an isostatic backbone that is missing; negative if there are more."""
    coefficient: float
    """c of p = c/(1 − φ/φ_J)."""
    overlap: float
    order: float
    """Q₆ of all bonds together, |ψ₆| of disks."""


def pack(binary: Path, arguments: list[str], slowly: tuple[float, float] | None = None) -> tuple[Jammed, int]:
    """A packing by ``haff pack``, and its collisions. ``slowly``: it goes on at this rate, to this pressure."""
    with tempfile.TemporaryDirectory(prefix="haff-validate-") as directory:
        output = Path(directory) / "packing.h5"
        command = [str(binary), "pack", *arguments, "--json", "--quiet", "--threads", "1", "-o", str(output)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(command)}\nexit {done.returncode}\n{done.stderr}")
        collisions = json.loads(done.stdout)["collisions"]
        if slowly is not None:
            scene = Path(directory) / "slowly.toml"
            rate, pressure = slowly
            scene.write_text(SLOWLY.format(count=arguments[0], start=output, rate=rate, pressure=pressure))
            output = Path(directory) / "slow.h5"
            collisions += run(binary, scene, {}, output)["collisions"]
        with haff.open_packing(output) as packing:
            network = packing.network
            return Jammed(
                packing.packing_fraction,
                1 - network.backbone_contacts / network.isostatic_contacts,
                packing.jamming_fraction().coefficient,
                haff.analysis.max_overlap(packing.frame).depth,
                packing.bond_order().whole,
            ), collisions


@dataclass(frozen=True)
class Case:
    """Packings of one kind, and what is expected of them."""

    name: str
    arguments: tuple[str, ...]
    seeds: int
    slowly: tuple[float, float] | None = None
    jamming: tuple[float, float] | None = None
    """φ_J and its uncertainty."""
    missing: float = 0.1
    """Largest part of the contacts that may be missing, in the mean."""


def packings(context: Context) -> list[Row]:
    """Packings by growth (`haff pack`). φ_J of equal spheres depends on the protocol: C. S. O'Hern, L. E. Silbert,
    A. J. Liu and S. R. Nagel, Phys. Rev. E 68, 011306 (2003), have 0.639 ± 0.001, growth 0.64 to 0.65 as its rate
    falls (A. Donev, S. Torquato, F. H. Stillinger, Phys. Rev. E 71, 011105 (2005)), so that the expectation is taken
    as uncertain by 0.004; disks of sizes 1 : 1.4 have 0.842 there and more if they grow slowly. Without friction the
    backbone is isostatic: 2d(1 − 1/N') + 2/N' contacts of a particle. Fast growth leaves some of them open, slow growth
    (0.001 from φ = 0.62 on, so that spheres have no time for a crystal before) at most 1 %. Near jamming
    p = d/(1 − φ/φ_J). Growth at a rate of 10⁻⁴ makes crystals."""
    ten, eight = context.effort(10, 2), context.effort(8, 2)
    two_sizes = ("--dimension", "2", "--sizes", "{ list = [0.5, 0.7] }", "--jammed", "--reduced-pressure", "1e10")
    spheres, disks = (0.641, 0.004), (0.845, 0.003)
    cases = [
        Case("1,000 spheres, rate 0.03", ("1000", "--jammed", "--rate", "0.03"), ten, jamming=spheres),
        Case("1,000 spheres, rate 0.01", ("1000", "--jammed", "--rate", "0.01"), ten, jamming=spheres),
        Case("10,000 spheres, rate 0.03", ("10000", "--jammed", "--rate", "0.03"), ten, jamming=spheres),
        Case(
            "1,000 spheres, rate 0.001 from φ = 0.62, p = 10¹⁰",
            ("1000", "--packing-fraction", "0.62", "--rate", "0.015"),
            eight, slowly=(0.001, 1e10), jamming=spheres, missing=0.01,
        ),
        Case(
            "1,000 disks 1 : 1.4, rate 0.002, p = 10¹⁰",
            ("1000", *two_sizes, "--rate", "0.002"), eight, jamming=disks, missing=0.01,
        ),
        Case(
            "500 spheres, rate 0.02, p = 10¹²",
            ("500", "--jammed", "--reduced-pressure", "1e12", "--rate", "0.02"), 2, jamming=spheres,
        ),
    ]  # fmt: skip
    crystals = Case(
        "500 spheres, rate 10⁻⁴", ("500", "--jammed", "--reduced-pressure", "1e6", "--rate", "1e-4"), ten // 2
    )
    mixture = Case(
        "700 spheres, six of radius 0.15 for each of 0.5",
        ("700", "--sizes", "{ list = [0.5, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15] }", "--rate", "0.003",
         "--packing-fraction", "0.7"), 2,
    )  # fmt: skip
    made = _made(context, [*cases, crystals, mixture])
    rows = [
        at_most(case.name, "overlap, largest", max(p.overlap for p in made[case]), 1e-12, "jammed") for case in made
    ]
    for case in cases:
        packs, d = made[case], 2 if "disks" in case.name else 3
        assert case.jamming is not None
        fractions, (value, doubt) = [p.packing_fraction for p in packs], case.jamming
        rows.append(compare(case.name, "φ_J", fractions, value, "published, by protocol", doubt))
        rows.append(at_most(case.name, "bond order, largest", max(p.order for p in packs), 0.2, "no order"))
        missing = abs(sum(p.missing for p in packs) / len(packs))
        rows.append(at_most(case.name, "contacts missing, mean", missing, case.missing, "isostatic"))
        if case.missing < 0.1:
            rows.append(compare(case.name, "c", [p.coefficient for p in packs], d, "p = d/(1 − φ/φ_J)", 0.02 * d))
    least = 0.69 - max(p.packing_fraction for p in made[crystals])
    rows.append(at_most(crystals.name, "0.69 − φ of the densest", least, 0.0, "denser than without order"))
    disorder = 0.3 - max(p.order for p in made[crystals])
    rows.append(at_most(crystals.name, "0.3 − Q₆, the largest", disorder, 0.0, "a crystal"))
    off = max(abs(p.packing_fraction - 0.7) for p in made[mixture])
    rows.append(at_most(mixture.name, "φ − 0.7, largest", off, 1e-12, "as asked for"))
    return rows


def _made(context: Context, cases: list[Case]) -> dict[Case, list[Jammed]]:
    """All packings of all cases."""
    work = [
        (context.binary, [*case.arguments, "--seed", str(seed)], case.slowly)
        for case in cases
        for seed in range(1, case.seeds + 1)
    ]
    done = context.map(pack, work)
    context.collisions += sum(collisions for _, collisions in done)
    found = iter(packing for packing, _ in done)
    return {case: [next(found) for _ in range(case.seeds)] for case in cases}


PARTS = (Part("packings", "Packings", packings, 85),)

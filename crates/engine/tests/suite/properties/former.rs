//! Scenes in which random runs have found errors. Each comment describes the error, which is now fixed.

use super::recipe::{PLAIN, Recipe};

/// Scenes where the replay had the wrong set of walls that support a grain.
pub const REPLAYED: [Recipe; 2] = [
    // A moving ramp pushes a grain along the wall it rests on, and so slowly off this wall that the
    // displacement is below the accumulated rounding.
    Recipe {
        boundary: [0, 1, 2],
        restitution: 4,
        gravity: true,
        ramp: 3,
        tc: true,
        speeds: true,
        wedge: true,
        seed: 12_801_591_799_708_678_778,
        ..PLAIN
    },
    // Rounding lifts a grain that slides along an edge off one of the two walls; it comes to rest on this
    // wall again.
    Recipe {
        boundary: [2, 1, 1],
        particles: 40,
        species: 2,
        restitution: 5,
        gravity: true,
        ramp: 2,
        tc: true,
        seed: 16_948_907_616_558_953_409,
        ..PLAIN
    },
];

/// All others.
pub const FORMER: [Recipe; 52] = [
    // A single particle, whose contact distance was its radius: lists came to a wall too late.
    Recipe {
        flat: true,
        boundary: [0, 1, 0],
        particles: 1,
        gravity: true,
        ramp: 2,
        measure: true,
        seed: 12_289_825_418_106_528_617,
        ..PLAIN
    },
    // A grain between walls in gravity, 30,000 equal bounces: each rounds the fall by the same part of an
    // ulp.
    Recipe {
        boundary: [1, 1, 2],
        particles: 6,
        species: 3,
        restitution: 1,
        gravity: true,
        ramp: 5,
        fixed: true,
        tc: true,
        fast: true,
        rough: 2,
        seed: 12_899_532_383_688_638_325,
        ..PLAIN
    },
    // Strongly sheared boxes: the bound of the test left out that the momentum is relative to the flow.
    Recipe {
        particles: 4,
        fast: true,
        drive: 1,
        rough: 1,
        shear: 2,
        seed: 11_042_863_456_927_717_623,
        ..PLAIN
    },
    Recipe {
        particles: 1,
        species: 2,
        restitution: 2,
        long: true,
        rough: 1,
        shear: 2,
        seed: 9_477_682_323_899_532_142,
        ..PLAIN
    },
    // Windows in a grid of two cells an edge missed a pair, whose search extends over the whole edge.
    Recipe {
        flat: true,
        particles: 4,
        restitution: 5,
        fixed: true,
        tc: true,
        fast: true,
        huge: true,
        changed: true,
        seed: 16_349_984_015_653_366_540,
        ..PLAIN
    },
    // A grain that a wall carries missed a ramp that moves as a triangle, behind a corner of its motion.
    Recipe {
        boundary: [1, 2, 0],
        particles: 36,
        species: 2,
        restitution: 5,
        gravity: true,
        ramp: 5,
        fixed: true,
        corner: true,
        changed: true,
        seed: 16_471_780_918_426_699_773,
        ..PLAIN
    },
    // A carried grain missed a contact that was closer than the least step of the search.
    Recipe {
        boundary: [1, 0, 1],
        particles: 145,
        restitution: 2,
        gravity: true,
        ramp: 5,
        long: true,
        seed: 1_656_580_822_843_638_733,
        ..PLAIN
    },
    Recipe {
        particles: 1,
        species: 3,
        restitution: 4,
        long: true,
        shear: 2,
        at_kick: true,
        seed: 9_477_682_465_989_997_108,
        ..PLAIN
    },
    // A box so large that the rounding of positions in it is beyond that of short flights.
    Recipe {
        flat: true,
        particles: 150,
        species: 3,
        restitution: 5,
        fixed: true,
        tc: true,
        far: true,
        changed: true,
        seed: 10_989_989_938_763_101_689,
        ..PLAIN
    },
    // An elastic gas with a contact duration: windows and lists kept no times of contacts.
    Recipe { particles: 2, tc: true, seed: 6_421_738_977_735_998_642, ..PLAIN },
    Recipe {
        flat: true,
        particles: 2,
        corner: true,
        changed: true,
        seed: 13_182_746_391_575_529_534,
        ..PLAIN
    },
    // At the end a wall carried a grain whose bounces had no row in the log yet.
    Recipe {
        flat: true,
        boundary: [2, 1, 0],
        particles: 9,
        species: 2,
        restitution: 4,
        gravity: true,
        ramp: 2,
        wedge: true,
        corner: true,
        seed: 1_580_523_316_449_873_171,
        ..PLAIN
    },
    // A sheared gas of fast, light particles in a large box: an overlap beyond rounding was reported.
    Recipe {
        particles: 8,
        tc: true,
        fast: true,
        speeds: true,
        far: true,
        light: true,
        rough: 1,
        shear: 2,
        seed: 17_526_106_699_705_555_713,
        ..PLAIN
    },
    // Contacts with a wall that is far beyond the face of its box, which lists missed.
    Recipe {
        boundary: [1, 1, 1],
        particles: 12,
        species: 2,
        restitution: 5,
        tc: true,
        ratios: true,
        seed: 3_121_322_358_736_976_792,
        ..PLAIN
    },
    // An event before the one that preceded it.
    Recipe {
        flat: true,
        boundary: [0, 2, 0],
        particles: 32,
        restitution: 2,
        fixed: true,
        speeds: true,
        light: true,
        wedge: true,
        long: true,
        corner: true,
        seed: 14_996_193_117_818_818_225,
        ..PLAIN
    },
    // The rounding errors of contacts with very fast images are relative to the paths of these, also of
    // slow particles.
    Recipe {
        flat: true,
        particles: 3,
        species: 3,
        restitution: 2,
        tc: true,
        fast: true,
        far: true,
        rough: 1,
        shear: 2,
        seed: 18_083_413_922_284_645_073,
        ..PLAIN
    },
    Recipe {
        flat: true,
        particles: 11,
        species: 2,
        restitution: 1,
        tc: true,
        fast: true,
        speeds: true,
        ratios: true,
        far: true,
        shear: 2,
        seed: 11_892_618_889_860_609_502,
        ..PLAIN
    },
    // A rough grain on a steep wall, released without slip, counted as rolling: the energy was off.
    Recipe {
        boundary: [1, 0, 1],
        particles: 24,
        species: 2,
        restitution: 2,
        gravity: true,
        ramp: 2,
        tc: true,
        fast: true,
        rest: true,
        light: true,
        rough: 1,
        seed: 9_361_904_626_613_470_982,
        ..PLAIN
    },
    // Friction began at the time of an event: predictions made since then, without it, still counted.
    Recipe {
        boundary: [1, 1, 0],
        particles: 6,
        species: 3,
        restitution: 2,
        gravity: true,
        ramp: 2,
        rough: 1,
        seed: 9_546_482_090_980_550_866,
        ..PLAIN
    },
    // Thousands of equal bounces during a fall along the wall: the momentum was off.
    Recipe {
        flat: true,
        boundary: [1, 2, 0],
        particles: 2,
        species: 3,
        restitution: 5,
        gravity: true,
        fixed: true,
        tc: true,
        seed: 9_642_959_682_629_271_077,
        ..PLAIN
    },
    // `contact.tc` kept a grain from coming to rest on a ramp: the grain penetrated the ramp.
    Recipe {
        boundary: [0, 1, 2],
        particles: 161,
        species: 2,
        restitution: 5,
        gravity: true,
        ramp: 2,
        fixed: true,
        tc: true,
        seed: 9_321_853_567_428_357_864,
        ..PLAIN
    },
    // A wall lifts a grain off the ramp it rests on, tens of thousands of times: the total impulse of the
    // supports was off.
    Recipe {
        boundary: [1, 0, 2],
        particles: 33,
        species: 3,
        restitution: 5,
        gravity: true,
        ramp: 2,
        fixed: true,
        seed: 7_128_820_349_724_052_757,
        ..PLAIN
    },
    // A grain between a wall and a ramp, both of e = 0, touches them in turn until its speed is zero: it
    // penetrated both.
    Recipe {
        boundary: [1, 0, 2],
        particles: 14,
        species: 3,
        restitution: 2,
        ramp: 2,
        seed: 9_776_165_189_665_064_590,
        ..PLAIN
    },
    // A grain between another grain and a viscoelastic wall bounces with decreasing height: tens of
    // thousands of roundings of its position.
    Recipe {
        flat: true,
        boundary: [1, 1, 0],
        particles: 24,
        species: 3,
        restitution: 5,
        gravity: true,
        ramp: 2,
        seed: 137_403_965_237_544_513,
        ..PLAIN
    },
    // A grain is stopped by a driven body and then leaves it by gravity: when the tick changed, their
    // contact was predicted again, in the past.
    Recipe {
        boundary: [2, 1, 2],
        particles: 47,
        species: 1,
        restitution: 5,
        gravity: true,
        fixed: true,
        tc: true,
        speeds: true,
        seed: 12_947_446_997_481_944_515,
        ..PLAIN
    },
    // A wall that closes a gap drives a grain to 7000 times its speed before it comes to rest: the
    // rounding errors are those of the largest speed.
    Recipe {
        flat: true,
        boundary: [1, 0, 0],
        particles: 1,
        species: 2,
        restitution: 3,
        gravity: true,
        ramp: 2,
        tc: true,
        rest: true,
        wedge: true,
        seed: 11_176_684_352_271_856_950,
        ..PLAIN
    },
    // A grain slides through eleven periodic images of the box before it hits another grain: the rounding
    // errors of both are relative to this distance, also after a wall has pressed them together.
    Recipe {
        flat: true,
        boundary: [1, 0, 0],
        particles: 37,
        restitution: 2,
        gravity: true,
        ramp: 2,
        tc: true,
        fast: true,
        far: true,
        seed: 16_336_519_524_857_192_935,
        ..PLAIN
    },
    // A fast grain makes the tick short, so there are many epochs: the anchor of a driven body is moved
    // at the end of every fourth one.
    Recipe {
        flat: true,
        boundary: [1, 0, 0],
        particles: 1,
        species: 3,
        restitution: 2,
        fixed: true,
        fast: true,
        seed: 7_407_130_976_972_376_444,
        ..PLAIN
    },
    // A series of viscoelastic bounces ended below rounding, but its loss was not in the ledger yet:
    // 5·10⁻¹¹ of the energy.
    Recipe {
        flat: true,
        boundary: [1, 0, 0],
        particles: 7,
        species: 2,
        restitution: 5,
        gravity: true,
        ramp: 2,
        fixed: true,
        ratios: true,
        seed: 13_803_761_589_488_762_894,
        ..PLAIN
    },
    Recipe {
        boundary: [0, 0, 1],
        particles: 1,
        species: 3,
        restitution: 5,
        gravity: true,
        light: true,
        seed: 2_351_363_783_347_639_464,
        ..PLAIN
    },
    // A heavy grain hops on a light grain at rest.
    Recipe {
        flat: true,
        boundary: [1, 1, 0],
        particles: 24,
        species: 3,
        restitution: 2,
        gravity: true,
        tc: true,
        rest: true,
        long: true,
        seed: 14_756_928_281_548_885_707,
        ..PLAIN
    },
    // A jam is one impact of many grains: one of them gains energy that others lose.
    Recipe {
        boundary: [0, 1, 2],
        particles: 6,
        species: 1,
        restitution: 2,
        gravity: true,
        ramp: 3,
        rest: true,
        seed: 14_981_057_028_972_551_245,
        ..PLAIN
    },
    // A grain slid on the oscillating ramp that carried it into a wall: both held it.
    Recipe {
        boundary: [1, 0, 1],
        particles: 1,
        restitution: 2,
        gravity: true,
        ramp: 4,
        fixed: true,
        seed: 1_505_822_609_933_031_162,
        ..PLAIN
    },
    // A grain carried by a ramp of triangular motion left its cell without a crossing.
    Recipe {
        boundary: [2, 1, 0],
        particles: 7,
        restitution: 2,
        gravity: true,
        ramp: 5,
        fast: true,
        light: true,
        seed: 16_268_886_430_880_774_076,
        ..PLAIN
    },
    // A ramp that carried a grain against gravity did not balance gravity: the energy was off.
    Recipe {
        boundary: [0, 1, 2],
        particles: 4,
        restitution: 5,
        gravity: true,
        ramp: 4,
        tc: true,
        seed: 6_995_711_486_851_887_860,
        ..PLAIN
    },
    // The images of a carried grain were not searched again by all pairs.
    Recipe {
        restitution: 1,
        gravity: true,
        ramp: 4,
        boundary: [0, 0, 1],
        fast: true,
        wedge: true,
        seed: 10_996_528_908_313_835_151,
        ..PLAIN
    },
    // A carried grain touched another one at a relative speed that was only rounding: the search for the
    // time of contact left its interval.
    Recipe {
        flat: true,
        boundary: [2, 1, 0],
        particles: 12,
        restitution: 2,
        gravity: true,
        ramp: 4,
        fast: true,
        seed: 4_313_848_481_575_773_114,
        ..PLAIN
    },
    // The tick was chosen for the speeds at the start, far below those that a drive and a thermal wall
    // give.
    Recipe {
        boundary: [2, 1, 1],
        particles: 12,
        species: 2,
        restitution: 5,
        ramp: 2,
        fixed: true,
        ratios: true,
        far: true,
        drive: 2,
        thermal: true,
        partition: true,
        seed: 13_933_417_233_481_059_801,
        ..PLAIN
    },
    // A grain that slid down a tilted wall was accelerated towards a partition.
    Recipe {
        flat: true,
        boundary: [1, 2, 0],
        particles: 16,
        species: 3,
        restitution: 5,
        gravity: true,
        fast: true,
        wedge: true,
        partition: true,
        seed: 3_827_168_627_932_850_006,
        ..PLAIN
    },
    // The time of the first event of an epoch was an ulp before that of the last event of the one before.
    Recipe {
        flat: true,
        boundary: [2, 0, 0],
        particles: 6,
        species: 2,
        restitution: 5,
        ramp: 4,
        fixed: true,
        tc: true,
        fast: true,
        speeds: true,
        light: true,
        seed: 5_807_157_289_978_195_913,
        ..PLAIN
    },
    // A light grain on an oscillating ramp hit two others in turn at one time: which one came first
    // depended on the order of the candidates.
    Recipe {
        flat: true,
        boundary: [1, 0, 0],
        particles: 4,
        species: 2,
        restitution: 5,
        gravity: true,
        ramp: 4,
        light: true,
        seed: 13_227_874_816_066_278_759,
        ..PLAIN
    },
    // The time of a row was an ulp before that of the row before, where an epoch of the clock starts.
    Recipe {
        boundary: [1, 0, 0],
        particles: 6,
        species: 3,
        restitution: 2,
        ramp: 2,
        fixed: true,
        tc: true,
        fast: true,
        rest: true,
        light: true,
        wedge: true,
        at_kick: true,
        seed: 14_876_147_644_409_779_396,
        ..PLAIN
    },
    Recipe {
        boundary: [1, 0, 0],
        particles: 9,
        species: 3,
        restitution: 2,
        gravity: true,
        ramp: 2,
        tc: true,
        wedge: true,
        at_kick: true,
        seed: 14_096_998_324_159_663_319,
        ..PLAIN
    },
    // The same: a contact at the start of the epoch was predicted again a few ticks before it.
    Recipe {
        particles: 12,
        species: 2,
        restitution: 2,
        fixed: true,
        fast: true,
        corner: true,
        seed: 941_525_937_578_705_560,
        ..PLAIN
    },
    // In a strongly sheared box, a new tick moved anchors whose images had come millions of lengths: the
    // bound of the overlap at the next contact counted from the new anchors.
    Recipe {
        particles: 17,
        species: 2,
        restitution: 5,
        tc: true,
        fast: true,
        speeds: true,
        far: true,
        light: true,
        rough: 1,
        shear: 2,
        seed: 5_556_621_419_330_972_740,
        ..PLAIN
    },
    // A grain between the floor and a huge body hops 110,000 times, until the collapse is reported.
    Recipe {
        boundary: [1, 1, 0],
        particles: 50,
        species: 2,
        restitution: 5,
        gravity: true,
        ramp: 2,
        long: true,
        huge: true,
        at_kick: true,
        seed: 10_977_374_311_273_764_609,
        ..PLAIN
    },
    // A wall of the box that moves on and on lets grains go beyond its face, to an oblique wall that no cell
    // there had.
    Recipe {
        boundary: [1, 0, 1],
        particles: 147,
        ramp: 4,
        fixed: true,
        fast: true,
        wedge: true,
        rough: 1,
        at_kick: true,
        changed: true,
        seed: 3_512_456_328_568_268_636,
        ..PLAIN
    },
    // A grain that comes to rest in a block, beside measured forces on walls: a block has no walls to note
    // its support for, and its step is undone.
    Recipe {
        boundary: [1, 0, 1],
        particles: 4,
        species: 2,
        restitution: 2,
        gravity: true,
        tc: true,
        measure: true,
        huge: true,
        seed: 46_612_318_866_018_574,
        ..PLAIN
    },
    // A partition that oscillates: lists took its place farthest to one side for particles on the other one,
    // too.
    Recipe {
        flat: true,
        boundary: [2, 2, 0],
        particles: 13,
        restitution: 1,
        ramp: 3,
        tc: true,
        thermal: true,
        partition: true,
        corner: true,
        at_kick: true,
        seed: 5_815_434_239_103_406_023,
        ..PLAIN
    },
    // Two disks that jam between two images of each other: an impact took the image twice, once the other
    // one, with its velocity.
    Recipe {
        flat: true,
        far: true,
        particles: 3,
        species: 3,
        restitution: 4,
        rough: 1,
        compression: 2,
        seed: 7_896_000_023_845_376_288,
        ..PLAIN
    },
    // Compression in far boxes: peculiar velocities at positions far from the origin are rounded by as much
    // as the flow there is faster.
    Recipe {
        flat: true,
        far: true,
        particles: 3,
        species: 3,
        restitution: 4,
        ratios: true,
        rough: 1,
        compression: 2,
        seed: 7_896_504_748_485_347_895,
        ..PLAIN
    },
    Recipe {
        boundary: [0, 0, 1],
        particles: 10,
        species: 1,
        restitution: 2,
        far: true,
        light: true,
        compression: 2,
        at_kick: true,
        seed: 11_138_549_520_111_439_356,
        ..PLAIN
    },
];

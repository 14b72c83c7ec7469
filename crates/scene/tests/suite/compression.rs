//! Boxes that are compressed, and growth: what is assembled, and what is refused.

use glam::DVec3;
use haff_engine::{DriveKind, WallMotion};
use haff_scene::{BoxTooSmall, Code, GrowthEnd, NoStates, Scene, SceneErrors, UntilOf, parse};

/// 64 spheres of diameter 1 in a cube of edge 8: a packing fraction of 0.0654.
fn scene(domain: &str, more: &str) -> Result<Scene, SceneErrors> {
    let text = format!(
        "schema = 1\n{more}\n[domain]\nsize = [8.0, 8.0, 8.0]\n{domain}\n[[species]]\nname = \"grain\"\ncount = 64\n\
         radius = 0.5\nmass = 1.0\n"
    );
    parse("compressed.toml", &text, &[], &NoStates)
}

const RUN: &str = "run.until = 1.0";
const FILLED: f64 = 64.0 * std::f64::consts::PI / 6.0;

fn sound(domain: &str, more: &str) -> Scene {
    scene(domain, more).unwrap_or_else(|errors| panic!("{errors}"))
}

/// Each scene is refused with one error, at this key.
fn refused(cases: &[(&str, &str, &str, Code, &str)]) {
    for &(domain, more, key, code, message) in cases {
        let errors = scene(domain, more).map(|_| ()).expect_err(message);
        assert_eq!(errors.errors.len(), 1, "{errors}");
        let error = &errors.errors[0];
        assert_eq!((error.path.as_str(), error.code), (key, code), "{errors}");
        assert!(error.message.contains(message), "expected: {message}\nfound: {errors}");
    }
}

#[test]
fn rates_are_those_of_all_axes_or_of_each() {
    let rates = |domain: &str| sound(domain, RUN).system.domain.compression.map(|found| found.rates);
    assert_eq!(rates("compression = { rate = 0.1 }"), Some(DVec3::splat(0.1)));
    assert_eq!(rates("compression = { rates = [0.1, -0.05, 0] }"), Some(DVec3::new(0.1, -0.05, 0.0)));
    assert_eq!(rates("compression = { rate = 0.0 }"), None);
    assert_eq!(rates("compression = { rates = [0, 0, 0] }"), None);
    let disks = "schema = 1\ndimension = 2\nrun.until = 1.0\ndomain = { size = [8, 8], compression = { rate = 0.1 } }\n\
                 species = [{ name = \"disk\", count = 9, radius = 0.5, mass = 1.0 }]";
    let found = parse("disks.toml", disks, &[], &NoStates).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(found.system.domain.compression.map(|found| found.rates), Some(DVec3::new(0.1, 0.1, 0.0)));
}

#[test]
fn velocities_are_those_of_the_temperature_and_of_the_flow_along_periodic_axes() {
    let rates = DVec3::new(0.3, 0.3, -0.2);
    let domain =
        "boundary = [\"periodic\", \"wall\", \"periodic\"]\ncompression = { rates = [0.3, 0.3, -0.2] }";
    let found = sound(domain, "run.until = 1.0\ninitial.temperature = 2.0").system;
    let flow = |position: DVec3| -rates * position * DVec3::new(1.0, 0.0, 1.0);
    let thermal: Vec<DVec3> = found.bodies.iter().map(|body| body.velocity - flow(body.position)).collect();
    assert!(thermal.iter().sum::<DVec3>().length() < 1e-12);
    let energy: f64 = thermal.iter().map(|velocity| velocity.length_squared()).sum();
    assert!((energy / (3.0 * 64.0) - 2.0).abs() < 1e-13, "{energy}");
}

#[test]
fn the_upper_wall_of_a_compressed_axis_moves() {
    let domain = "boundary = [\"periodic\", \"wall\", \"wall\"]\ncompression = { rates = [0, 0.25, 0] }";
    let walls = sound(domain, RUN).system.walls;
    let WallMotion::Constant(motion) = walls[1].motion else { panic!("{:?}", walls[1]) };
    assert_eq!((motion.velocity, motion.reference_time), (DVec3::new(0.0, -2.0, 0.0), 0.0));
    for k in [0, 2, 3] {
        assert_eq!(walls[k].motion, WallMotion::Fixed, "{}", walls[k].name);
    }
}

#[test]
fn the_run_ends_before_the_box_is_too_small() {
    // 64 spheres of the volume π/6 fill an edge of 3.5636 as densely as possible.
    let most = std::f64::consts::PI / (3.0 * 2_f64.sqrt());
    let full = 10.0 * (1.0 - (FILLED / most).cbrt() / 8.0);
    let found = sound("compression = { rate = 0.1 }", "run.collisions = 1000");
    assert_eq!(found.run.until_of, UntilOf::Box);
    assert!((found.run.until.unwrap() - full).abs() < 1e-12, "{:?}, {full}", found.run);
    assert!(matches!(found.box_limit.unwrap().why, BoxTooSmall::PackingFraction(_)));
    // Along one axis the edge is too short first; between walls it may be half as long.
    for (domain, time, least) in [
        ("compression = { rates = [0.1, 0, 0] }", 7.5, 2.0),
        (
            "boundary = [\"wall\", \"periodic\", \"periodic\"]\ncompression = { rates = [0.1, 0, 0] }",
            8.75,
            1.0,
        ),
    ] {
        let limit = sound(domain, RUN).box_limit.unwrap();
        assert_eq!(limit.why, BoxTooSmall::Edge(0, least));
        assert!((limit.time - time).abs() < 1e-12, "{limit:?}");
    }
    let found = sound("compression = { rate = -0.1 }", RUN);
    assert_eq!((found.box_limit, found.run.until, found.run.until_of), (None, Some(1.0), UntilOf::Run));
    let wall = "boundary = [\"wall\", \"periodic\", \"periodic\"]\ncompression = { rates = [0.1, 0, 0] }";
    let fixed = "run.until = 1.0\ninitial.positions = \"random\"\nparticle = [{ position = [5, 4, 4], radius = 0.5, mass = inf }]";
    let limit = sound(wall, fixed).box_limit.unwrap();
    assert_eq!((limit.time, limit.why), ((1.0 - 5.5 / 8.0) / 0.1, BoxTooSmall::Body(0, 64)));
}

#[test]
fn what_does_not_work_with_a_compression_is_refused_at_its_key() {
    use Code::{Conflict, Missing, Value};
    let key = "domain.compression";
    let walls = "boundary = [\"wall\", \"wall\", \"wall\"]\ncompression = { rate = 0.1 }\n";
    let gravity = format!("{walls}gravity = [0, 0, -1]");
    refused(&[
        ("compression = { rate = inf }", RUN, "domain.compression.rate", Value, "must be a finite number"),
        (
            "compression = { rates = [0.1, nan, 0] }",
            RUN,
            "domain.compression.rates.1",
            Value,
            "must be a finite",
        ),
        (
            "compression = { rates = [0.1, 0.1] }",
            RUN,
            "domain.compression.rates",
            Value,
            "must have three numbers",
        ),
        ("compression = {}", RUN, "domain.compression.rate", Missing, "the rate of all axes"),
        (
            "compression = { rate = 1, rates = [1, 1, 1] }",
            RUN,
            "domain.compression.rates",
            Conflict,
            "contradicts",
        ),
        (
            "compression = { rate = 0.1 }\nshear = { flow = \"x\", gradient = \"y\", rate = 1.0 }",
            RUN,
            key,
            Conflict,
            "contradicts domain.shear",
        ),
        (
            "boundary = [\"open\", \"wall\", \"wall\"]\ncompression = { rate = 0.1 }",
            RUN,
            "domain.compression.rate",
            Value,
            "must be 0 along x, which is open",
        ),
        (&gravity, RUN, "domain.gravity", Value, "must be 0 along z: with domain.compression, a wall"),
        (
            "boundary = [\"periodic\", \"wall\", \"wall\"]\ncompression = { rates = [0.1, 0, 0] }\ngravity = [0, 0, -1]",
            RUN,
            "domain.gravity",
            Value,
            "must be 0 along z: with domain.compression, images move",
        ),
        (
            walls,
            "run.until = 1.0\ncontact.pair = [{ between = [\"grain\", \"z-\"], sticks = true }]",
            key,
            Conflict,
            "does not work with pendulums",
        ),
        (
            "compression = { rate = 0.1 }",
            "run.until = 1.0\nparticle = [{ position = [1, 1, 1], radius = 0.5, mass = inf }]",
            "particle.0.mass",
            Value,
            "must be finite in a box whose images move",
        ),
        (
            walls,
            "run.until = 1.0\nwall = [{ name = \"floor\", plane = { point = [0, 0, 1], normal = [0, 0, 1] } }]",
            "wall.0.name",
            Conflict,
            "only a cylinder, a sphere and a cone with particles inside do",
        ),
        (
            walls,
            "run.until = 1.0\nwall = [{ name = \"a\", sphere = { center = [5, 5, 5], radius = 5 } }, { name = \"b\", sphere = { center = [5, 5, 5], radius = 4.9 } }]",
            key,
            Conflict,
            "works with one wall beside those of domain.boundary: a container",
        ),
        (
            walls,
            "run.until = 1.0\nwall = [{ name = \"a\", velocity = [0, 0, 1], sphere = { center = [5, 5, 5], radius = 5 } }]",
            "wall.0.velocity",
            Conflict,
            "does not work for a wall that shrinks",
        ),
        (
            walls,
            "run.until = 1.0\nwall = [{ name = \"a\", sphere = { center = [5, 5, 5], radius = 50 } }]",
            "wall.0.name",
            Conflict,
            "must be inside of the box",
        ),
        (
            "boundary = [\"wall\", \"wall\", \"wall\"]\ncompression = { rates = [0.1, 0.1, 0] }",
            "run.until = 1.0\nwall = [{ name = \"a\", sphere = { center = [5, 5, 5], radius = 5 } }]",
            "wall.0.name",
            Conflict,
            "only along all axes at the same rate",
        ),
        (
            walls,
            "run.until = 1.0\nwall = [{ name = \"z-\", motion = { kind = \"sine\", amplitude = 0.1, frequency = 1.0 } }]",
            "wall.0.motion",
            Conflict,
            "a wall of an axis whose edge changes",
        ),
        (
            walls,
            "run.until = 1.0\nwall = [{ name = \"z+\", displacement = 0.1 }]",
            "wall.0.displacement",
            Conflict,
            "a wall of an axis whose edge changes",
        ),
    ]);
}

/// Beside images that move, walls act only along their normals; cells of profiles do not change.
#[test]
fn walls_and_profiles_that_a_compression_would_move_past_are_refused() {
    let walled = "boundary = [\"periodic\", \"wall\", \"periodic\"]\ncompression = { rates = [0.3, 0, 0] }";
    let why = "does not work with thermal and rough walls";
    refused(&[
        (
            walled,
            "run.until = 1.0\nwall = [{ name = \"y-\", temperature = 1.0 }]",
            "domain",
            Code::Conflict,
            why,
        ),
        (walled, "run.until = 1.0\ncontact.tangential_restitution = 0.5", "domain", Code::Conflict, why),
        (
            "compression = { rate = 0.1 }",
            "run.until = 1.0\nmeasure.profiles = [{ axis = \"x\", bins = 4, interval = 0.1 }]",
            "measure.profiles",
            Code::Conflict,
            "does not work in a box that is compressed",
        ),
    ]);
    sound("compression = { rate = 0.1 }", "run.until = 1.0\ncontact.tangential_restitution = 0.5");
}

/// A packing grows to its fraction and is the start of an ordinary scene.
#[test]
fn dense_starts_grow() {
    let text = |positions: &str, sizes: &str, domain: &str| {
        format!(
            "schema = 1\nseed = 3\nrun.until = 1.0\n{domain}\ninitial.positions = {positions}\n\
             species = [{{ name = \"grain\", count = 150, radius = {sizes}, mass = 1.0 }}]"
        )
    };
    let run = |positions: &str, sizes: &str, domain: &str| {
        parse("dense.toml", &text(positions, sizes, domain), &[], &NoStates)
    };
    let mixed = "{ list = [0.3, 0.5, 0.6] }";
    for (packing, sizes, domain) in [
        (0.62, "0.5", ""),
        (0.6, mixed, ""),
        (0.55, "0.5", "domain.boundary = [\"wall\", \"wall\", \"periodic\"]"),
    ] {
        let positions = format!("{{ packing = {packing} }}");
        let found = run(&positions, sizes, domain).unwrap_or_else(|errors| panic!("{errors}"));
        assert!((found.packing_fraction / packing - 1.0).abs() < 1e-12);
        let mut simulation =
            haff_engine::Simulation::new(found.system.clone(), haff_engine::Options::default()).unwrap();
        simulation.measure_overlap().unwrap();
        // The same again, and from the scene that files record.
        let again = parse("dense.toml", &found.resolved, &[], &NoStates).unwrap();
        assert_eq!(again.system, found.system);
    }
    for (positions, domain, message) in [
        (
            "{ packing = 0.73 }",
            "",
            "has not been reached: these sizes have jammed at a packing fraction of 0.6",
        ),
        ("{ packing = 0.6 }", "domain.size = [9, 9, 9]", "contradicts the box"),
        ("{ packing = 1.2 }", "", "must have a packing in (0, 1)"),
        ("{ packing = 0.6, file = \"a.h5\" }", "", "give one of the two"),
    ] {
        let errors = run(positions, "0.5", domain).map(|_| ()).expect_err(message);
        assert!(errors.to_string().contains(message), "{errors}");
    }
}

#[test]
fn ends_beyond_the_limit_of_the_box_are_refused() {
    use Code::{Conflict, Value};
    refused(&[
        (
            "compression = { rate = 0.1 }",
            "run.until = 9.0",
            "run.until",
            Value,
            "must be less than 5.5455064093",
        ),
        (
            "compression = { rate = 0.1 }",
            "run.until = 9.0",
            "run.until",
            Value,
            "packing fraction is 0.74048",
        ),
        (
            "compression = { rates = [0.1, 0, 0] }",
            "run.until = 8.0",
            "run.until",
            Value,
            "must be less than 7.5: at that time the edge along x is only 2 long",
        ),
        (
            "compression = { rate = -1.0 }",
            "run.until = 1e20",
            "run.until",
            Conflict,
            "the edges at that time",
        ),
        (
            "compression = { rate = 1e3 }",
            "run.until = 1e-5",
            "domain.compression.rate",
            Conflict,
            "the mean free time",
        ),
    ]);
    let text = "schema = 1\nrun.until = 1.0\ndomain = { size = [1.5, 8, 8], compression = { rate = 0.1 } }\n\
                species = [{ name = \"grain\", count = 9, radius = 0.5, mass = 1.0 }]";
    let errors = parse("thin.toml", text, &[], &NoStates).unwrap_err();
    assert!(errors.to_string().contains("box too small for edges that move: 1.5 along x"), "{errors}");
}

#[test]
fn growth_is_a_compression_that_ends_on_a_packing_fraction() {
    let more = "growth = { rate = 0.1, temperature = 2.0, until_packing_fraction = 0.5 }";
    let found = sound("", more);
    assert_eq!(found.system.domain.compression.unwrap().rates, DVec3::splat(0.1));
    let DriveKind::Hold { temperature, longest } = found.system.drives[0].kind else { panic!() };
    assert_eq!((temperature, longest, &found.system.drives[0].species[..]), (2.0, 0.01 / 0.1, &[0][..]));
    assert_eq!(found.run.until_of, UntilOf::PackingFraction);
    let edge = 8.0 * (1.0 - 0.1 * found.run.until.unwrap());
    assert!((FILLED / edge.powi(3) - 0.5).abs() < 1e-14);
    // Diameters are those of the largest particles; an earlier end of the run comes first.
    let text = "schema = 1\nrun.until = 2.0\ngrowth = { rate = 0.1, until_packing_fraction = 0.8 }\n\
                domain = { size = [8, 8], boundary = [\"wall\", \"periodic\"] }\ndimension = 2\n\
                species = [{ name = \"a\", count = 9, radius = 0.4, mass = 1 }, { name = \"b\", count = 3, radius = 1, mass = 1 }]";
    let found = parse("disks.toml", text, &[], &NoStates).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(found.system.domain.compression.unwrap().rates, DVec3::new(0.05, 0.05, 0.0));
    assert_eq!(
        (found.run.until, found.run.until_of, found.system.drives.len()),
        (Some(2.0), UntilOf::Run, 0)
    );
    // The resolved scene ends at the same time.
    let again =
        parse("resolved.toml", &found.resolved, &[], &NoStates).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!((again.run, again.system), (found.run, found.system));
}

#[test]
fn growth_ends_on_a_reduced_pressure_or_where_the_box_is_full() {
    let found = sound("", "growth = { rate = 0.1, until_reduced_pressure = 1e3 }");
    assert_eq!(found.run.growth.unwrap().end, Some(GrowthEnd::ReducedPressure(1e3)));
    assert_eq!((found.run.until_of, found.run.until), (UntilOf::Box, Some(found.box_limit.unwrap().time)));
}

#[test]
fn what_does_not_work_with_growth_is_refused_at_its_key() {
    use Code::{Conflict, Missing, Value};
    let grow = "growth = { rate = 0.1, until_packing_fraction = 0.5 }";
    let with = |text: &str| format!("growth = {{ rate = 0.1, {text} }}");
    let walls = "boundary = [\"wall\", \"wall\", \"wall\"]\n";
    let gravity = format!("{walls}gravity = [0, 0, -1]");
    let both = with("until_packing_fraction = 0.5, until_reduced_pressure = 10");
    let fixed = format!("{grow}\nparticle = [{{ position = [1, 1, 1], radius = 0.5, mass = inf }}]");
    refused(&[
        (
            "",
            "growth = { until_packing_fraction = 0.5 }",
            "growth.rate",
            Missing,
            "the growth of the largest",
        ),
        (
            "",
            "growth = { rate = -0.1, until_packing_fraction = 0.5 }",
            "growth.rate",
            Value,
            "must be a positive",
        ),
        ("", "growth = { rate = 0.1 }", "run", Missing, "no end"),
        (
            "",
            &with("temperature = 0, until_packing_fraction = 0.5"),
            "growth.temperature",
            Value,
            "must be a positive",
        ),
        (
            "",
            &with("until_packing_fraction = 1.5"),
            "growth.until_packing_fraction",
            Value,
            "must be in (0, 1)",
        ),
        (
            "",
            &with("until_packing_fraction = 0.75"),
            "growth.until_packing_fraction",
            Value,
            "must be at most 0.740480",
        ),
        (
            "",
            &with("until_packing_fraction = 0.05"),
            "growth.until_packing_fraction",
            Value,
            "at the start, 0.0654",
        ),
        (
            "",
            &with("until_reduced_pressure = 0"),
            "growth.until_reduced_pressure",
            Value,
            "must be a positive",
        ),
        ("", &both, "growth.until_reduced_pressure", Conflict, "contradicts growth.until_packing_fraction"),
        ("compression = { rate = 0.1 }", grow, "growth", Conflict, "contradicts domain.compression"),
        (
            "shear = { flow = \"x\", gradient = \"y\", rate = 1.0 }",
            grow,
            "growth",
            Conflict,
            "contradicts domain.shear",
        ),
        ("boundary = [\"open\", \"wall\", \"wall\"]", grow, "growth", Conflict, "x is open"),
        (&gravity, grow, "domain.gravity", Value, "must be 0 with [growth]"),
        ("", &fixed, "particle.0.mass", Value, "must be finite with [growth]"),
        (
            walls,
            &format!("{grow}\ncontact.pair = [{{ between = [\"grain\", \"z-\"], sticks = true }}]"),
            "growth",
            Conflict,
            "pendulums",
        ),
    ]);
}

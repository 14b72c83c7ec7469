//! Malicious files: long ones, ones with many errors, and text that imitates messages.

use std::fmt::Write;
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

use haff_scene::{ErrorKind, LONGEST_FILE, NoStates, Place, Scene, SceneErrors, parse, text};

const SOUND: &str = "[domain]\nsize = [10, 10, 10]\n[run]\nuntil = 1\n\
                     [[particle]]\nname = \"ball\"\nposition = [5, 5, 5]\nradius = 0.5\nmass = 1\n";

/// Limit for each case, in processor time: far above a linear cost, and far below a quadratic one.
const TIME_LIMIT: Duration = Duration::from_secs(30);

/// Processor time of this thread, which other processes do not change.
#[cfg(unix)]
fn processor_time() -> Duration {
    use nix::time::{ClockId, clock_gettime};
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).expect("a clock").into()
}

#[cfg(not(unix))]
fn processor_time() -> Duration {
    Duration::ZERO
}

fn read(text: &str, overrides: &[String]) -> Result<Scene, SceneErrors> {
    let started = processor_time();
    let result = parse("scene.toml", text, overrides, &NoStates);
    let took = processor_time().saturating_sub(started);
    assert!(took < TIME_LIMIT, "{took:?} for {} bytes", text.len());
    result
}

fn refused(text: &str) -> SceneErrors {
    read(text, &[]).map(|_| ()).expect_err("the scene must be refused")
}

fn message(text: &str) -> String {
    refused(text).to_string()
}

/// `count` particles with gaps between them, each with `more` lines.
fn particles(count: usize, more: impl Fn(usize) -> String) -> String {
    let mut text = format!("[domain]\nsize = [{}, 10, 10]\n[run]\nuntil = 1\n", 2 * count);
    for k in 0..count {
        let x = 2 * k;
        let _ = write!(text, "[[particle]]\nposition = [{x}, 5, 5]\nradius = 0.5\nmass = 1\n{}", more(k));
    }
    text
}

#[test]
fn first_unknown_keys_are_reported_and_all_are_counted() {
    const COUNT: usize = 200_000;
    let mut text = String::new();
    for k in 0..COUNT {
        let _ = writeln!(text, "k{} = 1", COUNT - k);
    }
    let errors = refused(&(text + SOUND));
    assert_eq!((errors.errors.len(), errors.more), (SceneErrors::MOST, COUNT - SceneErrors::MOST));
    for (k, error) in errors.errors.iter().enumerate() {
        let Place::File { line, column, .. } = &error.place else { panic!("{error}") };
        assert_eq!((*line, *column, error.path.as_str()), (k + 1, 1, format!("k{}", COUNT - k).as_str()));
    }
    let message = errors.to_string();
    assert!(message.ends_with(&format!("\nand {} more", COUNT - SceneErrors::MOST)), "{message}");
    assert_eq!(message.lines().count(), SceneErrors::MOST + 1);
}

#[test]
fn every_error_of_every_particle_is_counted_once() {
    const COUNT: usize = 20_000;
    let errors = refused(&particles(COUNT, |_| "colour = 1\nspin = 2\nvelocity = \"fast\"\n".to_owned()));
    assert_eq!(errors.errors.len() + errors.more, 3 * COUNT);
    let first: Vec<String> = errors.errors[..4].iter().map(ToString::to_string).collect();
    assert!(first[0].starts_with("scene.toml:9: particle.0.colour = 1: unknown key"), "{first:?}");
    assert!(first[1].starts_with("scene.toml:10: particle.0.spin = 2: unknown key"), "{first:?}");
    assert_eq!(first[2], "scene.toml:11: particle.0.velocity = \"fast\": must be an array, not a string");
    assert!(first[3].starts_with("scene.toml:16: particle.1.colour"), "{first:?}");
}

#[test]
fn unknown_keys_are_found_in_tables_of_every_form() {
    let text = "species = [{ name = \"a\", count = 3, mass = 1, radius = { uniform = [1, 2], b = 1, a = 2 } }, { x = 1 }]\n\
                domain = { packing_fraction = 0.1, shape = 1 }\n\
                contact = { restitution = { modle = 1 }, pair = [{ betwen = 1 }] }\n\
                run = { until = 1 }\noutput = { frames = { lag = 1 }, events = { colums = 1 } }\n\
                initial = { positions = { files = 1 } }\npendulum = [{ bobb = 1 }]\nspring = [5]\nrod = [{ a.b.c = 1 }]\n";
    let message = message(text);
    for key in [
        "species.0.radius.a = 2",
        "species.0.radius.b = 1",
        "species.1.x = 1",
        "domain.shape = 1",
        "contact.restitution.modle = 1",
        "contact.pair.0.betwen = 1",
        "output.frames.lag = 1",
        "output.events.colums = 1",
        "initial.positions.files = 1",
        "pendulum.0.bobb = 1",
        "rod.0.a = { b … }",
    ] {
        assert!(message.contains(&format!("{key}: unknown key")), "{key} in\n{message}");
    }
    assert!(message.contains("spring.0 = 5: must be a table, not an integer"), "{message}");
    assert!(
        message.contains("did you mean `between`?")
            && message.contains("(allowed: log, collisions_per_particle)"),
        "{message}"
    );
}

#[test]
#[ignore = "long: scripts/test all"]
fn reading_time_is_linear_in_the_length_of_the_file() {
    const COUNT: usize = 20_000;
    // Many names of the wrong kind, duplicate names, or unknown names.
    let mut text = particles(COUNT, |k| format!("name = \"p{}\"\n", k / 2));
    for k in 0..COUNT {
        let _ = write!(text, "[[pendulum]]\npivot = [0, 0, 0]\nbob = \"q{k}\"\nangle = 0.1\nlength = 1\n");
        let _ = write!(text, "[[contact.pair]]\nbetween = [\"r{k}\", \"p{k}\"]\nrestitution = 2\n");
    }
    assert!(refused(&text).more > 2 * COUNT);
    let walls: String = (0..COUNT).map(|_| "[[wall]]\nname = \"x\"\n".to_owned()).collect();
    assert!(refused(&(walls + SOUND)).errors[0].message.contains("at most 10000 walls"));
    // Overrides by name, and of names.
    let text = particles(COUNT, |k| format!("name = \"p{}\"\n", k % 50));
    let overrides: Vec<String> = (0..2000).map(|k| format!("particle.p{}.mass={}", k % 50, 1 + k)).collect();
    let scene = read(&text, &overrides).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(scene.system.classes[0].mass, 1951.0);
    let overrides: Vec<String> = (0..2000).map(|k| format!("x{k}.y=1")).collect();
    assert_eq!(read(&text, &overrides).map(|_| ()).map_err(|errors| errors.more), Err(1980));
    let comments = "#\n".repeat(1 << 20);
    assert!(read(&(comments + SOUND), &[]).is_ok());
}

#[test]
fn overrides_by_name_apply_to_names_set_by_earlier_overrides() {
    let overrides = ["particle.ball.mass=2", "particle.ball.name=stone", "particle.stone.radius=0.25"];
    let scene = read(SOUND, &overrides.map(str::to_owned)).unwrap_or_else(|errors| panic!("{errors}"));
    let class = &scene.system.classes[0];
    assert_eq!((class.mass, class.radius), (2.0, 0.25));
    let overrides = ["particle.ball.mass=2", "particle.0={ name = \"a\" }", "particle.ball.mass=3"];
    let message = read(SOUND, &overrides.map(str::to_owned)).expect_err("no ball is left").to_string();
    assert!(
        message.contains("nothing in `particle` is named `ball`; take a name (a) or an index"),
        "{message}"
    );
}

#[test]
fn control_characters_of_a_scene_are_escaped_in_messages() {
    let hidden = "\\u001b[2J\\r\\nerror: forged\\u202e\\u0085\\u0007";
    let key = format!("\"{hidden}\"");
    for text in [
        format!("{key} = 1\n{SOUND}"),
        format!("[{key}]\n{SOUND}"),
        format!("title = {key}\n[run]\nuntil = 1\n[domain]\nsize = {key}\n"),
        SOUND.replace("\"ball\"", &key).replace("mass = 1", "mass = -1\n") + "[contact]\nrestitution = 2\n",
        format!("{SOUND}[[contact.pair]]\nbetween = [{key}, \"ball\"]\nrestitution = 1\n"),
        format!(
            "{SOUND}[[wall]]\nname = {key}\nplane = {{ point = [0, 0, 0], normal = [0, 0, 0] }}\n[[wall]]\nname = {key}\n"
        ),
        format!("{SOUND}[[pendulum]]\npivot = [5, 5, 6]\nbob = {key}\n"),
        format!("{SOUND}[initial]\npositions = {key}\n"),
        // A file with the characters themselves, which TOML forbids; the parser's message may quote them.
        "a\u{1b}[31mb = 1\n".to_owned(),
        "a = \u{1b}\u{202e}x\n".to_owned(),
        "run.until = 1\u{2028}\n".to_owned(),
    ] {
        let Err(errors) = parse("a\u{1b}\nerror: b.toml", &text, &[], &NoStates) else {
            panic!("accepted: {text}")
        };
        let message = errors.to_string();
        assert_eq!(message.lines().count(), errors.errors.len(), "{message:?}");
        assert_eq!(text::escaped_lines(&message), message, "{message:?}");
        assert!(message.lines().all(|line| line.starts_with(r"a\u{1b}\nerror: b.toml:")), "{message:?}");
    }
    for text in ["contact.\u{1b}[2J=1", "run.until=\u{1b}\nerror: x", "title\n=[", "particle.\u{1b}.mass=1"] {
        let message = read(SOUND, &[text.to_owned()]).expect_err("refused").to_string();
        assert!(text::escaped(&message) == message && message.starts_with("--set "), "{message:?}");
    }
}

#[test]
fn long_parts_of_an_error_are_cut() {
    let long = "é".repeat(1 << 20);
    for text in [
        format!("\"{long}\" = 1\n{SOUND}"),
        format!("{SOUND}[\"{long}\".\"{long}\"]\n"),
        format!("title = {}1{}\n{SOUND}", "[".repeat(50), "]".repeat(50)),
        format!("title = [{}]\n{SOUND}", "1,".repeat(1 << 20)),
        SOUND.replace("0.5", &format!("\"{long}\"")),
        format!("{SOUND}[[contact.pair]]\nbetween = [\"{long}\", \"ball\"]\nrestitution = 1\n"),
        format!("{SOUND}[[pendulum]]\npivot = [5, 5, 6]\nbob = \"{long}\"\n"),
        particles(2000, |k| format!("name = \"{}{k}\"\n", "n".repeat(2000))),
    ] {
        let errors = refused(&text);
        for error in &errors.errors {
            let line = error.to_string();
            assert!(line.chars().count() < 5000, "{} characters", line.chars().count());
        }
    }
    let message = read(SOUND, &[format!("title=[{long}")]).expect_err("refused").to_string();
    // The override, the key, and what is allowed.
    assert!(message.chars().count() < 300 && message.contains('…'), "{} characters", message.len());
}

#[test]
fn texts_beyond_memory_or_stack_limits_are_refused_before_parsing() {
    let key = vec!["a"; 60].join(".");
    let nested = format!("{}{key} = 1{}\n", format!("{key} = {{").repeat(60), "}".repeat(60));
    for text in [&nested, &format!("a = {}{}\n", "[".repeat(100_000), "]".repeat(100_000))] {
        assert!(message(text).contains("tables and arrays may nest 80 deep"), "{}", message(text));
        let message =
            read(SOUND, &[format!("title = {{ {} }}", text.trim())]).expect_err("refused").to_string();
        assert!(message.contains("may nest 80 deep"), "{message}");
    }
    // 16 MB of this would be 16 GB of tables. Texts beyond any machine's memory are refused on all.
    let mut dots = String::new();
    for k in 0..600_000 {
        let _ = writeln!(dots, "b{k}{} = 1", ".a".repeat(78));
    }
    assert!(message(&dots).contains("of memory"), "{}", message(&dots));
}

#[test]
fn file_beyond_the_length_limit_is_refused_without_reading_it() {
    let folder = std::env::temp_dir().join(format!("haff-scene-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("long.toml");
    let mut file = std::fs::File::create(&path).unwrap();
    file.write_all(SOUND.as_bytes()).unwrap();
    file.set_len(LONGEST_FILE + 1).unwrap();
    let load = |path: &Path| haff_scene::load(path, &[], &NoStates).map(|_| ()).expect_err("too long");
    // Bytes that this thread has read so far; 0 where the system does not tell.
    let bytes_read = || -> u64 {
        let text = std::fs::read_to_string("/proc/thread-self/io").unwrap_or_default();
        text.lines().find_map(|line| line.strip_prefix("rchar: ")?.parse().ok()).unwrap_or(0)
    };
    let before = bytes_read();
    let errors = load(&path);
    assert!(bytes_read() - before < LONGEST_FILE / 2, "{} bytes were read", bytes_read() - before);
    assert!(
        errors.kind() == ErrorKind::Invalid && errors.to_string().contains("may have 256 MiB"),
        "{errors}"
    );
    std::fs::write(&path, b"\x89HDF\r\n\x1a\n").unwrap();
    std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(LONGEST_FILE + 1).unwrap();
    assert_eq!(load(&path).kind(), ErrorKind::Unreadable);
    std::fs::remove_dir_all(&folder).unwrap();
    if cfg!(target_os = "linux") {
        let errors = load(Path::new("/dev/zero"));
        assert!(errors.to_string().contains("/dev/zero: a scene file may have 256 MiB"), "{errors}");
    }
}

#[test]
fn integer_out_of_range_is_one_error() {
    let scene = |seed: &str| format!("seed = {seed}\n{SOUND}");
    assert_eq!(
        message(&scene("18446744073709551615")),
        "scene.toml:1: seed = 18446744073709551615: must be in 0..=9223372036854775807"
    );
    assert_eq!(message(&scene("-1")), "scene.toml:1: seed = -1: must be in 0..=9223372036854775807");
    assert_eq!(
        parse("s", &scene("9223372036854775807"), &[], &NoStates).map(|scene| scene.seed),
        Ok(i64::MAX as u64)
    );
    assert!(message(&scene("1e19")).contains("must be an integer; written as a float, at most 2^53"));
    let message = read(SOUND, &["seed=99999999999999999999".to_owned()]).expect_err("refused").to_string();
    assert_eq!(message, "--set seed=99999999999999999999: must be in 0..=9223372036854775807");
}

#[test]
fn text_that_files_cannot_store_is_refused() {
    let more = "title = \"T\"\n[output]\nfile = \"F\"\n[[wall]]\nname = \"W\"\nplane = { point = [0, 0, 0], normal = [0, 0, 1] }\n\
                [[species]]\nname = \"S\"\ncount = 1\nradius = 0.1\nmass = 1\n";
    let scene = |name: &str, by: &str| {
        let text = format!("{more}{SOUND}")
            .replace("[10, 10, 10]", "[10, 10, 10]\nboundary = [\"wall\", \"wall\", \"wall\"]");
        text.replace(&format!("\"{name}\""), &format!("\"{by}\""))
    };
    for (name, key) in [
        ("T", "title"),
        ("F", "output.file"),
        ("W", "wall.0.name"),
        ("S", "species.0.name"),
        ("ball", "particle.0.name"),
    ] {
        let message = message(&scene(name, "a\\u0000b"));
        assert!(message.ends_with(&format!(": {key} = \"a\\u{{0}}b\": must not contain the character NUL (U+0000), which files cannot store")), "{message}");
    }
    let joints = "domain.boundary = [\"open\", \"open\", \"open\"]\n[run]\nuntil = 1\n\
                  [[particle]]\nname = \"a\"\nposition = [0, 0, 0]\nradius = 0.1\nmass = 1\n\
                  [[particle]]\nname = \"b\"\nposition = [1, 0, 0]\nradius = 0.1\nmass = 1\n";
    for (list, keys) in [
        ("pendulum", "pivot = [0, 0, 1]\nbob = \"a\""),
        ("spring", "between = [\"a\", \"b\"]\nstiffness = 1"),
        ("rod", "between = [\"a\", \"b\"]"),
    ] {
        let message = message(&format!("{joints}[[{list}]]\nname = \"\\u0000\"\n{keys}\n"));
        assert!(message.contains(&format!("{list}.0.name = \"\\u{{0}}\": must not contain")), "{message}");
    }
}

#[test]
fn radii_below_the_rounding_of_coordinates_are_refused() {
    let radius = |radius: f64| SOUND.replace("radius = 0.5", &format!("radius = {radius:e}"));
    let least = 10.0 * 0.5_f64.powi(42);
    assert!(read(&radius(1.001 * least), &[]).is_ok());
    let message_below = message(&radius(0.999 * least));
    assert!(
        message_below.contains("particle.0.radius = ") && message_below.contains("must be at least 2.3e-12"),
        "{message_below}"
    );
    assert!(
        message(&radius(1e-30))
            .contains("particle.0.radius = 1e-30: must be at least 2.3e-12: coordinates up to 10 are")
    );
    // Along open axes the largest coordinate is that of the outermost particle.
    let open = |x: f64| {
        let boundary = "boundary = [\"open\", \"open\", \"open\"]";
        radius(1e-6).replace("size = [10, 10, 10]", boundary).replace("[5, 5, 5]", &format!("[{x:e}, 0, 0]"))
    };
    assert!(read(&open(-1e6), &[]).is_ok());
    assert!(message(&open(-1e7)).contains("coordinates up to 10000000 are"), "{}", message(&open(-1e7)));
    let species = "[domain]\nsize = [1, 1, 1]\n[run]\nuntil = 1\n[[species]]\nname = \"a\"\ncount = 3\nmass = 1\n\
                   radius = { uniform = [1e-20, 0.1] }\n[initial]\npositions = \"random\"\n";
    assert!(
        message(species).contains("species.0.radius = { uniform … }: must be at least 2.3e-13"),
        "{}",
        message(species)
    );
}

#[test]
fn planes_must_be_their_own_images_along_periodic_axes() {
    let scene = |boundary: [&str; 3], normal: &str| {
        format!(
            "[domain]\nsize = [10, 10, 10]\nboundary = {boundary:?}\n[run]\nuntil = 1\n\
             [[particle]]\nposition = [5, 5, 5]\nradius = 0.5\nmass = 1\n\
             [[wall]]\nname = \"w\"\nvelocity = [0, 1, 0]\nplane = {{ point = [0, 0, 0], normal = {normal} }}\n"
        )
    };
    for (boundary, normal, axis) in [
        (["wall", "periodic", "wall"], "[0.8, 0.6, 0]", "y"),
        (["wall", "periodic", "wall"], "[1, 1e-17, 0]", "y"),
        (["wall", "periodic", "wall"], "[1, 1e-300, 0]", "y"),
        (["wall", "wall", "periodic"], "[0, 0, 1]", "z"),
        (["periodic", "wall", "open"], "[-1e-9, 2, 0]", "x"),
    ] {
        let message = message(&scene(boundary, normal));
        let expected = format!("must be exactly 0 along {axis}, which is periodic");
        assert!(message.contains("wall.0.plane.normal = [") && message.contains(&expected), "{message}");
        assert!(message.contains(&format!("make {axis} \"wall\" or \"open\"")), "{message}");
        assert!(
            read(
                &scene(boundary.map(|kind| if kind == "periodic" { "wall" } else { kind }), "[1, 1, 1]"),
                &[]
            )
            .is_ok()
        );
    }
    for (boundary, normal) in [
        (["wall", "periodic", "wall"], "[3, 0, -0.0]"),
        (["periodic", "periodic", "open"], "[0, 0, 7]"),
        (["open", "periodic", "open"], "[1, 0, 1e-300]"),
    ] {
        let result = read(&scene(boundary, normal), &[]);
        assert!(result.is_ok(), "{boundary:?} {normal}: {result:?}");
    }
    // In two dimensions z is not an axis of the box.
    let flat = "dimension = 2\n[domain]\nsize = [10, 10]\nboundary = [\"wall\", \"periodic\"]\n[run]\nuntil = 1\n\
                [[particle]]\nposition = [8, 1]\nradius = 0.5\nmass = 1\n\
                [[wall]]\nname = \"tilted\"\nplane = { point = [8, 5], normal = [-0.8, -0.6] }\n";
    assert!(
        message(flat).contains("wall.0.plane.normal = [-0.8, -0.6]: must be exactly 0 along y"),
        "{}",
        message(flat)
    );
    assert!(read(&flat.replace("-0.6", "0"), &[]).is_err(), "the particle is inside that wall");
    assert!(read(&flat.replace("-0.8, -0.6", "1, 0, 0").replace("[8, 5]", "[0, 5]"), &[]).is_ok());
}

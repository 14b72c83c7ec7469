//! The scenes of `configs/`: valid ones are accepted, invalid ones refused with the error in their first
//! line.

use std::path::{Path, PathBuf};

use haff_scene::{ErrorKind, NoStates, load, parse};

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs")
}

fn scenes(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(configs().join(folder))
        .expect("the folder exists")
        .map(|entry| entry.expect("readable").path())
        .filter(|path| path.extension().is_some_and(|ext| ext == "toml"))
        .collect();
    files.sort();
    files
}

#[test]
fn every_scene_is_accepted_and_its_resolved_text_is_the_same_scene() {
    let files = [scenes("."), scenes("textbook")].concat();
    assert!(files.len() >= 12, "only {} scenes", files.len());
    for path in files {
        let scene = load(&path, &[], &NoStates).unwrap_or_else(|errors| panic!("{errors}"));
        let again = parse("resolved.toml", &scene.resolved, &[], &NoStates).unwrap_or_else(|errors| {
            panic!("{}: resolved scene refused:\n{errors}\n{}", path.display(), scene.resolved)
        });
        // NaN, where kinetic theory does not apply, is not equal to itself.
        let bits =
            |scene: &haff_scene::Scene| (scene.packing_fraction.to_bits(), scene.collision_rate.to_bits());
        assert_eq!(bits(&scene), bits(&again), "{}", path.display());
        assert_eq!(scene.rate_unknown, again.rate_unknown, "{}", path.display());
        let comparable = |mut scene: haff_scene::Scene| {
            (scene.packing_fraction, scene.collision_rate) = (0.0, 0.0);
            scene
        };
        assert!(comparable(scene) == comparable(again), "{} changes when resolved", path.display());
    }
}

#[test]
fn every_invalid_scene_is_refused_with_the_error_in_its_first_line() {
    let files = scenes("invalid");
    assert!(files.len() >= 30, "only {} scenes", files.len());
    let mut wrong = Vec::new();
    for path in files {
        let text = std::fs::read_to_string(&path).expect("readable");
        let expected = text
            .lines()
            .next()
            .and_then(|line| line.strip_prefix("# expect: "))
            .unwrap_or_else(|| panic!("{} does not state the expected error", path.display()));
        match load(&path, &[], &NoStates) {
            Ok(_) => wrong.push(format!("{} was accepted", path.display())),
            Err(errors) => {
                if !errors.to_string().contains(expected) {
                    wrong.push(format!("{}\n  expected: {expected}\n  found: {errors}", path.display()));
                }
                let unreadable = path.file_stem().is_some_and(|stem| stem == "state_file_missing");
                let kind = if unreadable { ErrorKind::Unreadable } else { ErrorKind::Invalid };
                assert_eq!(errors.kind(), kind, "{}", path.display());
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_template_is_accepted() {
    let mut names = Vec::new();
    for template in haff_scene::templates() {
        let name = template.name;
        assert_ne!(template.title(), name, "a title");
        assert_eq!(haff_scene::template(name), Some(template));
        // A mesh is read from the folder of the scene.
        if template.files.is_empty() {
            parse(name, template.text, &[], &NoStates).unwrap_or_else(|errors| panic!("{name}: {errors}"));
        }
        names.push(name.to_owned());
    }
    names.sort();
    let mut shipped: Vec<String> = [".", "textbook"]
        .into_iter()
        .flat_map(scenes)
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    shipped.sort();
    assert_eq!(names, shipped, "all scenes of configs, each once");
}

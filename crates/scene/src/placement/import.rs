//! Files of other programs: which of them scenes start from, by the endings of their names.

use std::{fs::File, io::Read, path::Path};

/// Endings of the files of other programs that are read; any other file is taken for an output file of haff.
pub const FOREIGN: [&str; 10] =
    ["gsd", "xyz", "extxyz", "csv", "lammpstrj", "dump", "data", "lmp", "xml", "bz2"];

/// The first bytes of an HDF5 file without a user block.
const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Bytes that are read to tell what a file is.
const HEAD: u64 = 4096;

/// How a scene can start from a file that has been taken for an output file of haff, and is none; empty if it
/// is HDF5, or if there is no such file.
pub(crate) fn hint(path: &Path) -> String {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    if read.is_err() || head.starts_with(HDF5) || is_foreign(path) {
        return String::new();
    }
    let endings = FOREIGN.map(|ending| format!(".{ending}")).join(", ");
    let read = format!("scenes start from output files of haff, or from {endings}");
    match program(path, &String::from_utf8_lossy(&head)) {
        Some((program, ending)) => {
            format!("; it is {program}: give its name the ending .{ending}, by which haff knows the format")
        }
        None => format!(
            "; {read}: write a table of numbers as .csv, with a line of names first: x,y,z,vx,vy,vz,radius"
        ),
    }
}

/// Whether a file of this name is one of another program that is read.
pub fn is_foreign(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| FOREIGN.contains(&ending.as_str()))
}

/// What a file is, by its first lines and the ending of its name, and the ending with which it is read.
fn program(path: &Path, head: &str) -> Option<(&'static str, &'static str)> {
    let lines = || head.lines().map(|line| line.split_once('#').map_or(line, |(before, _)| before).trim());
    let name = path.to_string_lossy().to_lowercase();
    if head.starts_with("ITEM: ") {
        Some(("a dump of LAMMPS", "lammpstrj"))
    } else if lines().any(|line| line.ends_with(" atoms") || line.ends_with(" xhi")) {
        Some(("a data file of LAMMPS", "data"))
    } else if head.contains("<DynamOconfig") || name.ends_with(".xml.bz2") {
        Some(("a configuration of DynamO", "xml"))
    } else if lines().next().is_some_and(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        words.len() == 8 && words.iter().all(|word| word.parse::<f64>().is_ok())
    }) {
        Some(("a file of MercuryDPM", "data"))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_programs_are_told_by_their_first_lines() {
        for (name, head, expected) in [
            ("a.lammpstrj", "ITEM: TIMESTEP\n0\n", Some(("a dump of LAMMPS", "lammpstrj"))),
            (
                "a.lmp",
                "made by hand\n\n12 atoms # all\n1 atom types\n",
                Some(("a data file of LAMMPS", "data")),
            ),
            ("a.data", "grains\n\n0 5 xlo xhi\n", Some(("a data file of LAMMPS", "data"))),
            ("a.data", "3 0.0 0 0 0 1 1 1\n0 0 0 1\n", Some(("a file of MercuryDPM", "data"))),
            ("a.xml", "<?xml version=\"1.0\"?>\n<DynamOconfig>", Some(("a configuration of DynamO", "xml"))),
            ("a.xml.bz2", "BZh9", Some(("a configuration of DynamO", "xml"))),
            ("a.txt", "1 2 3\n", None),
            ("a.txt", "", None),
        ] {
            assert_eq!(program(Path::new(name), head), expected, "{name}");
        }
    }

    #[test]
    fn a_hint_is_given_for_files_that_are_not_hdf5() {
        let folder = std::env::temp_dir().join(format!("haff-import-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = |name: &str, content: &[u8]| {
            let path = folder.join(name);
            std::fs::write(&path, content).unwrap();
            path
        };
        let dump = hint(&path("a.txt", b"ITEM: TIMESTEP\n0\n"));
        assert!(dump.starts_with("; it is a dump of LAMMPS: give its name the ending .lammpstrj"), "{dump}");
        let text = hint(&path("a.txt", b"1 2 3\n"));
        assert!(
            text.contains(
                "from .gsd, .xyz, .extxyz, .csv, .lammpstrj, .dump, .data, .lmp, .xml, .bz2: write a table"
            ),
            "{text}"
        );
        for (name, content) in [("a.h5", HDF5), ("b.csv", b"x,y\n")] {
            assert_eq!(hint(&path(name, content)), "", "{name}");
        }
        assert_eq!(hint(&folder.join("missing.txt")), "");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

//! What each search says that it can run, it runs: with the events of all pairs, on one thread and in
//! blocks. What it says that it cannot, is refused with its reason. docs/searches.md has the same table.

use haff_engine::{
    EngineError, NeighborChoice, Options, SearchSupport, Silent, Simulation, System, Until, searches,
};

use crate::common::features::{SEARCHES, features, table};

/// State, energies and forces on walls after some collisions, and the number of events that blocks have
/// taken.
fn run(system: &System, neighbors: NeighborChoice, blocks: Option<u16>) -> Result<(String, u64), String> {
    let options = Options { neighbors, blocks, ..Options::default() };
    let mut simulation = match Simulation::new(system.clone(), options) {
        Err(EngineError::Unsuitable { why, .. }) => return Err(why),
        new => new.unwrap(),
    };
    simulation.sample();
    simulation.advance(Until { time: 3.0, ..Until::default() }, &mut Silent).unwrap();
    simulation.validate(1e-12).unwrap();
    let sample = simulation.sample();
    let walls = (sample.wall_force, sample.wall_heat_flow);
    Ok((
        format!("{} {:?} {walls:?}", simulation.state_hash(), simulation.ledger().terms),
        simulation.block_counts().events(),
    ))
}

#[test]
#[ignore = "long: scripts/test all"]
fn each_search_runs_what_it_says_and_refuses_the_rest() {
    let mut shared = 0;
    for (feature, system) in features() {
        let found = searches(&system, Options::default()).unwrap();
        assert_eq!(found.iter().filter(|search| search.chosen).count(), 1, "{feature}");
        let (expected, _) = run(&system, NeighborChoice::AllPairs, None).unwrap();
        for neighbors in SEARCHES {
            let of_choice = || found.iter().filter(|search| search.choice == neighbors.name());
            let can_run = |search: &&SearchSupport| search.refuses.is_none();
            for blocks in [None, Some(2)] {
                match (run(&system, neighbors, blocks), of_choice().find(can_run)) {
                    (Ok((state, taken)), Some(search)) => {
                        assert_eq!(state, expected, "{feature}: {neighbors:?}, {blocks:?}");
                        let is_serial = of_choice().filter(can_run).all(|search| search.serial.is_some());
                        assert!(taken == 0 || !is_serial, "{feature}: {} shares events", search.name);
                        shared += usize::from(taken > 0);
                    }
                    (Err(why), None) => {
                        assert!(
                            of_choice().any(|search| search.refuses.as_ref() == Some(&why)),
                            "{feature}: {why}"
                        );
                    }
                    (found, said) => panic!("{feature}: {neighbors:?}: {found:?}, said to be {said:?}"),
                }
            }
        }
    }
    assert!(shared >= 20, "{shared} runs have shared events");
}

#[test]
fn the_page_of_searches_has_this_table() {
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/searches.md")).unwrap();
    let (_, rest) = page.split_once("<!-- begin matrix -->\n\n").unwrap();
    let (found, _) = rest.split_once("\n<!-- end matrix -->").unwrap();
    assert_eq!(found, table(), "`cargo run -p haff-engine --example matrix` prints it");
}

//! Searches are complete: two particles that could touch before either leaves its cell are candidates of each
//! other.

use glam::DVec3;
use haff_neighbors::{
    AllPairs, Axis, Cells, Deforming, DeformingCells, DeformingPairs, Flight, Geometry, Plane, Search, Shift,
    Sliding,
};
use proptest::prelude::*;

/// Particles in free flight: positions at time 0, and velocities.
#[derive(Debug, Clone)]
struct Scene {
    geometry: Geometry,
    flights: Vec<(DVec3, DVec3)>,
}

impl Scene {
    fn position(&self, i: u32, time: f64) -> DVec3 {
        let (position, velocity) = self.flights[i as usize];
        position + velocity * time
    }

    /// Along a bounded axis a particle collides with its wall before it leaves.
    fn is_inside(&self, i: u32, time: f64) -> bool {
        let p = self.position(i, time);
        (0..3).all(|axis| {
            self.geometry.axes[axis] != Axis::Bounded || (0.0..=self.geometry.size[axis]).contains(&p[axis])
        })
    }

    fn flight(&self, i: u32, time: f64) -> Flight {
        let velocity = self.flights[i as usize].1;
        let now = self.ticks(time);
        Flight { position: self.position(i, time), velocity, acceleration: DVec3::ZERO, now }
    }

    fn ticks(&self, time: f64) -> i64 {
        self.geometry.deforming.map_or(0, |images| images.start + (time / images.tick).round() as i64)
    }

    /// Edge vectors of the box at `time`, by row. Along the flow images are counted from the start of the
    /// run, `turns` edges before.
    fn edges(&self, time: f64) -> [DVec3; 3] {
        let size =
            self.geometry.size + self.geometry.deforming.map_or(DVec3::ZERO, |images| images.speeds * time);
        let mut edges = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        if let Some(sliding) = self.sliding() {
            edges[sliding.gradient][sliding.flow] =
                sliding.turns as f64 * size[sliding.flow] + sliding.offset + sliding.speed * time;
        }
        edges
    }

    fn sliding(&self) -> Option<Sliding> {
        self.geometry.deforming?.sliding
    }

    /// Contact distance of a pair.
    fn contact(&self, i: u32, j: u32) -> f64 {
        let radii = &self.geometry.radii;
        if radii.is_empty() { self.geometry.reach } else { radii[i as usize] + radii[j as usize] }
    }

    /// Every image of every pair that is within reach.
    fn touching(&self, time: f64) -> Vec<(u32, u32, Shift)> {
        let mut found = Vec::new();
        let count = self.flights.len() as u32;
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let r = self.position(j, time) - self.position(i, time);
            let edges = self.edges(time);
            let range = |axis: usize, x: f64| {
                let nearest = -(x / edges[axis][axis]).round() as i32;
                if self.geometry.axes[axis] == Axis::Periodic { nearest - 1..=nearest + 1 } else { 0..=0 }
            };
            // The flow last: its image depends on that across the gradient.
            let flow = self.sliding().map_or(0, |sliding| sliding.flow);
            let [a, b] = [(flow + 1) % 3, (flow + 2) % 3];
            for up in range(a, r[a]) {
                for beside in range(b, r[b]) {
                    let moved = r + edges[a] * f64::from(up) + edges[b] * f64::from(beside);
                    for along in range(flow, moved[flow]) {
                        if (moved + edges[flow] * f64::from(along)).length() < self.contact(i, j) {
                            let mut shift = [0; 3];
                            (shift[a], shift[b], shift[flow]) = (up, beside, along);
                            found.push((i, j, shift));
                        }
                    }
                }
            }
        }
        found
    }
}

fn scene() -> impl Strategy<Value = Scene> {
    let axis = prop_oneof![3 => Just(Axis::Periodic), 1 => Just(Axis::Bounded), 1 => Just(Axis::Open), 1 => Just(Axis::Flat)];
    let unit = prop::array::uniform3(0.0_f64..1.0);
    let flights = prop::collection::vec((unit.clone(), unit), 2..40);
    // Radii of 0.02 … 0.5 in half of the scenes.
    let radii = prop::option::of(prop::collection::vec(prop_oneof![0.02_f64..0.06, 0.06..0.5], 40));
    (prop::array::uniform3(axis), prop::array::uniform3(1.2_f64..9.0), flights, radii).prop_map(
        |(axes, size, flights, radii)| {
            let moving = |axis: usize, value: f64| if axes[axis] == Axis::Flat { 0.0 } else { value };
            let flights: Vec<_> = flights
                .into_iter()
                .map(|(place, motion)| {
                    let position = [0, 1, 2].map(|axis| moving(axis, place[axis] * size[axis]));
                    let velocity = [0, 1, 2].map(|axis| moving(axis, motion[axis] - 0.5));
                    (DVec3::from_array(position), DVec3::from_array(velocity))
                })
                .collect();
            let size = DVec3::from_array(size);
            let radii = radii.map_or(Vec::new(), |radii| radii[..flights.len()].to_vec());
            Scene {
                geometry: Geometry {
                    size,
                    axes,
                    reach: 1.0,
                    crowding: 1.0,
                    radius: 0.5,
                    radii,
                    planes: Vec::new(),
                    deforming: None,
                },
                flights,
            }
        },
    )
}

/// Scenes under simple shear: any two axes, both signs of the rate, images that have slid by many edges.
fn sheared_scene() -> impl Strategy<Value = Scene> {
    let unit = prop::array::uniform3(0.0_f64..1.0);
    let flights = prop::collection::vec((unit.clone(), unit), 2..40);
    let axes = (0_usize..3, 0_usize..2, any::<bool>());
    let shear = (prop_oneof![Just(0.0), -2.0_f64..2.0], 0.0_f64..1.0, -3_i64..4);
    (axes, prop::array::uniform3(2.05_f64..9.0), flights, shear).prop_map(
        |((flow, other, flat), size, flights, (rate, offset, turns))| {
            let gradient = (flow + 1 + other) % 3;
            let side = 3 - flow - gradient;
            let flights = flights.into_iter().map(|(place, motion)| {
                let still = |axis: usize, x: f64| if flat && axis == side { 0.0 } else { x };
                let position = DVec3::from_array([0, 1, 2].map(|k| still(k, place[k] * size[k])));
                let mut velocity = DVec3::from_array([0, 1, 2].map(|k| still(k, motion[k] - 0.5)));
                velocity[flow] += rate * position[gradient];
                (position, velocity)
            });
            let mut axes = [Axis::Periodic; 3];
            if flat {
                axes[side] = Axis::Flat;
            }
            let sliding = Sliding {
                flow,
                gradient,
                speed: rate * size[gradient],
                offset: (offset - 0.5) * size[flow],
                turns,
            };
            let deforming = Deforming {
                sliding: Some(sliding),
                speeds: DVec3::ZERO,
                start: 12_345,
                tick: 2.0_f64.powi(-50),
                horizon: f64::INFINITY,
            };
            Scene {
                flights: flights.collect(),
                geometry: Geometry {
                    size: DVec3::from_array(size),
                    axes,
                    reach: 1.0,
                    crowding: 1.0,
                    radius: 0.5,
                    radii: Vec::new(),
                    planes: Vec::new(),
                    deforming: Some(deforming),
                },
            }
        },
    )
}

/// Scenes in boxes that become shorter or longer along any axes, up to a quarter in the horizon, some of them
/// with walls or open along other axes.
fn stretched_scene() -> impl Strategy<Value = Scene> {
    let axis = prop_oneof![
        6 => Just(Axis::Periodic), 1 => Just(Axis::Bounded), 1 => Just(Axis::Open), 1 => Just(Axis::Flat)
    ];
    let unit = prop::array::uniform3(0.0_f64..1.0);
    let flights = prop::collection::vec((unit.clone(), unit), 2..40);
    let rates = prop::array::uniform3(prop_oneof![Just(0.0), -1.0_f64..1.0]);
    let scales = (prop::array::uniform3(1.6_f64..9.0), 0.05_f64..0.25, 0.1_f64..3.0);
    (prop::array::uniform3(axis), scales, flights, rates).prop_map(
        |(axes, (size, change, horizon), flights, rates)| {
            let images = |k: usize| f64::from(u8::from(axes[k] == Axis::Periodic));
            let rates = DVec3::from_array([0, 1, 2].map(|k| images(k) * rates[k] * change / horizon));
            let flights = flights.into_iter().map(|(place, motion)| {
                let moving = |k: usize, x: f64| if axes[k] == Axis::Flat { 0.0 } else { x };
                let position = DVec3::from_array([0, 1, 2].map(|k| moving(k, place[k] * size[k])));
                let velocity = DVec3::from_array([0, 1, 2].map(|k| moving(k, motion[k] - 0.5)));
                (position, velocity + rates * position)
            });
            let size = DVec3::from_array(size);
            let deforming = Deforming {
                sliding: None,
                speeds: rates * size,
                start: 12_345,
                tick: 2.0_f64.powi(-50),
                horizon,
            };
            Scene {
                flights: flights.collect(),
                geometry: Geometry {
                    size,
                    axes,
                    reach: 1.0,
                    crowding: 1.0,
                    radius: 0.5,
                    radii: Vec::new(),
                    planes: Vec::new(),
                    deforming: Some(deforming),
                },
            }
        },
    )
}

/// Whether the pair is among the candidates of either particle.
fn is_candidate(candidates: &[Vec<(u32, Shift)>], i: u32, j: u32, shift: Shift) -> bool {
    candidates[i as usize].contains(&(j, shift)) || candidates[j as usize].contains(&(i, shift.map(|s| -s)))
}

/// Advances the particles from crossing to crossing. Between any two crossings, all pairs that touch must be
/// candidates from either partner's last search; and the new candidates of a crossing must include all that
/// were not candidates before.
fn check_completeness<S: Search>(scene: &Scene, steps: usize) -> Result<(), TestCaseError> {
    let count = scene.flights.len() as u32;
    let mut time = 0.0;
    let mut search =
        S::new(&scene.geometry, &(0..count).map(|i| scene.position(i, time)).collect::<Vec<_>>());
    let next = |search: &S, i: u32, time: f64| {
        let crossing = search.next_crossing(i, &scene.flight(i, time), f64::INFINITY)?;
        Some((time + crossing.delay, crossing.code))
    };
    let list_candidates = |search: &S, i: u32, time: f64| {
        let mut list = Vec::new();
        search.candidates(
            i,
            scene.ticks(time),
            |k| scene.position(k, time),
            |j, shift| list.push((j, shift)),
        );
        list
    };
    let mut candidates: Vec<_> = (0..count).map(|i| list_candidates(&search, i, time)).collect();
    let mut due: Vec<_> = (0..count).map(|i| next(&search, i, time)).collect();
    for _ in 0..steps {
        let dues = (0..count).filter_map(|i| due[i as usize].map(|due| (i, due)));
        let Some((i, (when, code))) = dues.min_by(|a, b| a.1.0.total_cmp(&b.1.0)) else { break };
        if when > scene.geometry.deforming.map_or(f64::INFINITY, |images| images.horizon) {
            break;
        }
        if !scene.is_inside(i, when) {
            due[i as usize] = None;
            continue;
        }
        let between = 0.5 * (time + when);
        for (a, b, shift) in scene.touching(between) {
            if scene.is_inside(a, between) && scene.is_inside(b, between) {
                prop_assert!(
                    is_candidate(&candidates, a, b, shift),
                    "t = {between}: {a} and {b}, shift {shift:?}"
                );
            }
        }
        time = when;
        search.cross(i, code, &scene.flight(i, time));
        let mut new = Vec::new();
        search.new_candidates(
            i,
            code,
            scene.ticks(time),
            |k| scene.position(k, time),
            |j, shift| new.push((j, shift)),
        );
        let all = list_candidates(&search, i, time);
        for candidate in &all {
            let before = is_candidate(&candidates, i, candidate.0, candidate.1);
            prop_assert!(
                before || new.contains(candidate),
                "{candidate:?} of {i} is neither an old nor a new candidate"
            );
        }
        candidates[i as usize] = all;
        due[i as usize] = next(&search, i, time);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300, rng_seed: proptest::test_runner::RngSeed::Fixed(2), ..ProptestConfig::default()
    })]

    #[test]
    #[ignore = "long: scripts/test all"]
    fn cells_are_complete(scene in scene()) {
        check_completeness::<Cells>(&scene, 300)?;
    }

    #[test]
    #[ignore = "long: scripts/test all"]
    fn all_pairs_are_complete(scene in scene()) {
        check_completeness::<AllPairs>(&scene, 300)?;
    }

    #[test]
    #[ignore = "long: scripts/test all"]
    fn sheared_cells_are_complete(scene in sheared_scene()) {
        check_completeness::<DeformingCells>(&scene, 400)?;
    }

    #[test]
    #[ignore = "long: scripts/test all"]
    fn sheared_pairs_are_complete(scene in sheared_scene()) {
        check_completeness::<DeformingPairs>(&scene, 400)?;
    }

    #[test]
    fn cells_are_complete_in_a_box_that_changes_its_size(scene in stretched_scene()) {
        check_completeness::<DeformingCells>(&scene, 400)?;
    }

    #[test]
    fn pairs_are_complete_in_a_box_that_changes_its_size(scene in stretched_scene()) {
        check_completeness::<DeformingPairs>(&scene, 400)?;
    }

    #[test]
    fn wrapping_an_anchor_shifts_its_images_in_a_box_that_changes_its_size(
        scene in stretched_scene(), i in 0_usize..40, wraps in prop::array::uniform3(-3..4_i32)
    ) {
        let i = (i % scene.flights.len()) as u32;
        let wraps = [0, 1, 2].map(|axis| if scene.geometry.axes[axis] == Axis::Periodic { wraps[axis] } else { 0 });
        let positions: Vec<DVec3> = scene.flights.iter().map(|flight| flight.0).collect();
        shifts_images::<DeformingCells>(&scene.geometry, &positions, i, wraps)?;
    }

    #[test]
    fn wrapping_an_anchor_shifts_its_images_under_shear(
        scene in sheared_scene(), i in 0_usize..40, wraps in prop::array::uniform3(-3..4_i32)
    ) {
        let i = (i % scene.flights.len()) as u32;
        let wraps = [0, 1, 2].map(|axis| if scene.geometry.axes[axis] == Axis::Periodic { wraps[axis] } else { 0 });
        let positions: Vec<DVec3> = scene.flights.iter().map(|flight| flight.0).collect();
        shifts_images::<DeformingCells>(&scene.geometry, &positions, i, wraps)?;
    }

    /// Wrapping an anchor changes coordinates, not cells.
    #[test]
    fn wrapping_an_anchor_shifts_its_images(
        scene in scene(), i in 0_usize..40, wraps in prop::array::uniform3(-3..4_i32)
    ) {
        let i = (i % scene.flights.len()) as u32;
        let wraps = [0, 1, 2].map(|axis| if scene.geometry.axes[axis] == Axis::Periodic { wraps[axis] } else { 0 });
        let positions: Vec<DVec3> = scene.flights.iter().map(|flight| flight.0).collect();
        shifts_images::<Cells>(&scene.geometry, &positions, i, wraps)?;
    }
}

fn sorted_candidates<S: Search>(search: &S, k: u32) -> Vec<(u32, Shift)> {
    let mut list = Vec::new();
    search.candidates(k, 0, |_| DVec3::ZERO, |j, shift| list.push((j, shift)));
    list.sort_unstable();
    list
}

fn shifts_images<S: Search>(
    geometry: &Geometry,
    positions: &[DVec3],
    i: u32,
    wraps: [i32; 3],
) -> Result<(), TestCaseError> {
    let mut search = S::new(geometry, positions);
    let count = positions.len() as u32;
    let before: Vec<_> = (0..count).map(|k| sorted_candidates(&search, k)).collect();
    search.rewrap(i, wraps);
    for k in 0..count {
        let mut expected = before[k as usize].clone();
        for (j, shift) in &mut expected {
            for axis in 0..3 {
                // The anchor of i has moved by −w L, so shifts of its images are larger by w, and those of
                // others relative to it smaller by w.
                shift[axis] += (i32::from(*j == i) - i32::from(k == i)) * wraps[axis];
            }
        }
        expected.sort_unstable();
        prop_assert_eq!(sorted_candidates(&search, k), expected);
    }
    Ok(())
}

#[test]
fn a_cell_holds_ten_thousand_particles_and_is_emptied_again() {
    let size = DVec3::splat(30.0);
    let geometry = Geometry {
        size,
        axes: [Axis::Periodic; 3],
        reach: 1.0,
        crowding: 1.0,
        radius: 0.5,
        radii: Vec::new(),
        planes: Vec::new(),
        deforming: None,
    };
    let mut search = Cells::new(&geometry, &vec![DVec3::splat(15.1); 10_000]);
    let count = |search: &Cells, i| {
        let mut count = 0;
        search.candidates(i, 0, |_| DVec3::ZERO, |_, _| count += 1);
        count
    };
    assert_eq!(count(&search, 77), 9_999);
    let stay = Flight { position: DVec3::ZERO, velocity: DVec3::ZERO, acceleration: DVec3::ZERO, now: 0 };
    // All but ten move five cells away, along x, and back.
    for i in 10..10_000 {
        (0..5).for_each(|_| search.cross(i, 1, &stay));
    }
    assert_eq!((count(&search, 0), count(&search, 10)), (9, 9_989));
    for i in (10..10_000).rev() {
        (0..5).for_each(|_| search.cross(i, 0, &stay));
    }
    assert_eq!(count(&search, 9_999), 9_999);
}

#[test]
fn only_cells_near_a_wall_list_it() {
    let plane = |x: f64, normal| Plane { point: DVec3::new(x, 0.0, 0.0), normal, sweep: 0.0, surface: None };
    let geometry = Geometry {
        size: DVec3::splat(20.0),
        axes: [Axis::Bounded, Axis::Periodic, Axis::Periodic],
        reach: 1.0,
        crowding: 1.0,
        radius: 0.5,
        radii: Vec::new(),
        planes: vec![plane(0.0, DVec3::X), plane(20.0, DVec3::NEG_X)],
        deforming: None,
    };
    let place = |i: i32| DVec3::new(f64::from(i % 20), f64::from(i / 20 % 20), f64::from(i / 400)) + 0.5;
    let positions: Vec<DVec3> = (0..8000).map(place).collect();
    let search = Cells::new(&geometry, &positions);
    assert_eq!((search.walls(0), search.walls(10), search.walls(19)), (&[0_u16][..], &[][..], &[1_u16][..]));
    assert_eq!(AllPairs::new(&geometry, &positions[..3]).walls(0), &[0, 1]);
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 30, rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default()
    })]

    #[test]
    fn sheared_cells_are_complete_in_a_few_scenes(scene in sheared_scene()) {
        check_completeness::<DeformingCells>(&scene, 200)?;
    }

    #[test]
    fn sheared_pairs_are_complete_in_a_few_scenes(scene in sheared_scene()) {
        check_completeness::<DeformingPairs>(&scene, 200)?;
    }
}

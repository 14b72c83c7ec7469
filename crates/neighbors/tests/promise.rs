//! What a search promises: two particles that could touch before either changes its place are candidates of each other.

use glam::DVec3;
use haff_neighbors::{AllPairs, Axis, Cells, Flight, Geometry, Plane, Search, Shift};
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

    /// In a bounded axis a particle meets its wall before it leaves.
    fn is_inside(&self, i: u32, time: f64) -> bool {
        let p = self.position(i, time);
        (0..3).all(|axis| {
            self.geometry.axes[axis] != Axis::Bounded || (0.0..=self.geometry.size[axis]).contains(&p[axis])
        })
    }

    /// Every image of every pair that is within reach.
    fn touching(&self, time: f64) -> Vec<(u32, u32, Shift)> {
        let mut found = Vec::new();
        let count = self.flights.len() as u32;
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let r = self.position(j, time) - self.position(i, time);
            let range = |axis: usize| {
                let nearest = -(r[axis] / self.geometry.size[axis]).round() as i32;
                if self.geometry.axes[axis] == Axis::Periodic { nearest - 1..=nearest + 1 } else { 0..=0 }
            };
            for x in range(0) {
                for y in range(1) {
                    for z in range(2) {
                        let shift = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * self.geometry.size;
                        if (r + shift).length() < self.geometry.reach {
                            found.push((i, j, [x, y, z]));
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
    (prop::array::uniform3(axis), prop::array::uniform3(1.2_f64..9.0), flights).prop_map(
        |(axes, size, flights)| {
            let moving = |axis: usize, value: f64| if axes[axis] == Axis::Flat { 0.0 } else { value };
            let flights = flights
                .into_iter()
                .map(|(place, motion)| {
                    let position = [0, 1, 2].map(|axis| moving(axis, place[axis] * size[axis]));
                    let velocity = [0, 1, 2].map(|axis| moving(axis, motion[axis] - 0.5));
                    (DVec3::from_array(position), DVec3::from_array(velocity))
                })
                .collect();
            let size = DVec3::from_array(size);
            Scene { geometry: Geometry { size, axes, reach: 1.0, radius: 0.5, planes: Vec::new() }, flights }
        },
    )
}

/// Whether the pair is among the candidates of either.
fn is_known(known: &[Vec<(u32, Shift)>], i: u32, j: u32, shift: Shift) -> bool {
    known[i as usize].contains(&(j, shift)) || known[j as usize].contains(&(i, shift.map(|s| -s)))
}

/// Lets the particles fly from transfer to transfer. Between any two, all that touch must be candidates from either
/// partner's last search; and a transfer's new candidates must be all that were not known before.
fn keeps_its_promise<S: Search>(scene: &Scene, steps: usize) -> Result<(), TestCaseError> {
    let count = scene.flights.len() as u32;
    let mut time = 0.0;
    let mut search =
        S::new(&scene.geometry, &(0..count).map(|i| scene.position(i, time)).collect::<Vec<_>>());
    let next = |search: &S, i: u32, time: f64| {
        let (position, velocity) = (scene.position(i, time), scene.flights[i as usize].1);
        let transfer = search.next_transfer(i, &Flight { position, velocity, acceleration: DVec3::ZERO })?;
        Some((time + transfer.delay, transfer.code))
    };
    let look = |search: &S, i: u32, time: f64| {
        let mut list = Vec::new();
        search.candidates(i, |k| scene.position(k, time), |j, shift| list.push((j, shift)));
        list
    };
    let mut known: Vec<_> = (0..count).map(|i| look(&search, i, time)).collect();
    let mut due: Vec<_> = (0..count).map(|i| next(&search, i, time)).collect();
    for _ in 0..steps {
        let dues = (0..count).filter_map(|i| due[i as usize].map(|due| (i, due)));
        let Some((i, (when, code))) = dues.min_by(|a, b| a.1.0.total_cmp(&b.1.0)) else { break };
        if !scene.is_inside(i, when) {
            due[i as usize] = None;
            continue;
        }
        let between = 0.5 * (time + when);
        for (a, b, shift) in scene.touching(between) {
            if scene.is_inside(a, between) && scene.is_inside(b, between) {
                prop_assert!(is_known(&known, a, b, shift), "t = {between}: {a} and {b}, shift {shift:?}");
            }
        }
        time = when;
        search.transfer(i, code);
        let mut new = Vec::new();
        search.new_candidates(i, code, |k| scene.position(k, time), |j, shift| new.push((j, shift)));
        let all = look(&search, i, time);
        for candidate in &all {
            let before = is_known(&known, i, candidate.0, candidate.1);
            prop_assert!(before || new.contains(candidate), "{candidate:?} of {i} is neither old nor new");
        }
        known[i as usize] = all;
        due[i as usize] = next(&search, i, time);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300, rng_seed: proptest::test_runner::RngSeed::Fixed(2), ..ProptestConfig::default()
    })]

    #[test]
    fn cells_miss_no_contact(scene in scene()) {
        keeps_its_promise::<Cells>(&scene, 300)?;
    }

    #[test]
    fn all_pairs_miss_no_contact(scene in scene()) {
        keeps_its_promise::<AllPairs>(&scene, 300)?;
    }

    /// An anchor that is wrapped changes coordinates, not places.
    #[test]
    fn wrapping_an_anchor_shifts_its_images(
        scene in scene(), i in 0_usize..40, wraps in prop::array::uniform3(-3..4_i32)
    ) {
        let i = (i % scene.flights.len()) as u32;
        let wraps = [0, 1, 2].map(|axis| if scene.geometry.axes[axis] == Axis::Periodic { wraps[axis] } else { 0 });
        let positions: Vec<DVec3> = scene.flights.iter().map(|flight| flight.0).collect();
        let mut search = Cells::new(&scene.geometry, &positions);
        let list = |search: &Cells, k: u32| {
            let mut list = Vec::new();
            search.candidates(k, |_| DVec3::ZERO, |j, shift| list.push((j, shift)));
            list.sort_unstable();
            list
        };
        let count = positions.len() as u32;
        let before: Vec<_> = (0..count).map(|k| list(&search, k)).collect();
        search.rewrap(i, wraps);
        for k in 0..count {
            let mut expected = before[k as usize].clone();
            for (j, shift) in &mut expected {
                for axis in 0..3 {
                    // i's anchor has moved by −w L, so its images count w more, and others' seen from it w less.
                    shift[axis] += (i32::from(*j == i) - i32::from(k == i)) * wraps[axis];
                }
            }
            expected.sort_unstable();
            prop_assert_eq!(list(&search, k), expected);
        }
    }
}

#[test]
fn ten_thousand_particles_fit_into_one_cell_and_leave_it_again() {
    let size = DVec3::splat(30.0);
    let geometry = Geometry { size, axes: [Axis::Periodic; 3], reach: 1.0, radius: 0.5, planes: Vec::new() };
    let mut search = Cells::new(&geometry, &vec![DVec3::splat(15.1); 10_000]);
    let count = |search: &Cells, i| {
        let mut count = 0;
        search.candidates(i, |_| DVec3::ZERO, |_, _| count += 1);
        count
    };
    assert_eq!(count(&search, 77), 9_999);
    // All but ten move five cells away, along x, and back.
    for i in 10..10_000 {
        (0..5).for_each(|_| search.transfer(i, 1));
    }
    assert_eq!((count(&search, 0), count(&search, 10)), (9, 9_989));
    for i in (10..10_000).rev() {
        (0..5).for_each(|_| search.transfer(i, 0));
    }
    assert_eq!(count(&search, 9_999), 9_999);
}

#[test]
fn only_cells_near_a_wall_know_it() {
    let plane = |x: f64, normal| Plane { point: DVec3::new(x, 0.0, 0.0), normal, moving: false };
    let geometry = Geometry {
        size: DVec3::splat(20.0),
        axes: [Axis::Bounded, Axis::Periodic, Axis::Periodic],
        reach: 1.0,
        radius: 0.5,
        planes: vec![plane(0.0, DVec3::X), plane(20.0, DVec3::NEG_X)],
    };
    let place = |i: i32| DVec3::new(f64::from(i % 20), f64::from(i / 20 % 20), f64::from(i / 400)) + 0.5;
    let positions: Vec<DVec3> = (0..8000).map(place).collect();
    let search = Cells::new(&geometry, &positions);
    assert_eq!((search.walls(0), search.walls(10), search.walls(19)), (&[0_u16][..], &[][..], &[1_u16][..]));
    assert_eq!(AllPairs::new(&geometry, &positions[..3]).walls(0), &[0, 1]);
}

use crate::report::observables::{Observable, Quantity, Sizes, row};

use super::two_spheres;

/// Energy lost per collision of two particles; no number before the first collision.
const LOSS_PER_COLLISION: Observable = row(
    "loss_per_collision",
    "energy",
    Quantity::Real(|sample| sample.ledger.dissipated / sample.collisions as f64),
    |_present| true,
);

#[test]
fn the_row_gives_the_name_and_the_number_of_a_sample() {
    let mut simulation = two_spheres();
    let until = crate::Until { time: 2.0, ..crate::Until::default() };
    simulation.advance(until, &mut crate::Silent).expect("no error");
    let mut numbers = Vec::new();
    LOSS_PER_COLLISION.quantity.append(&simulation.sample(), Sizes::of(simulation.system()), &mut numbers);
    // One contact at relative speed 2 with e = 0.5: μ v² (1 − e²)/2.
    assert_eq!(numbers, [0.5 * 0.5 * 4.0 * 0.75]);
    assert_eq!(LOSS_PER_COLLISION.name, "loss_per_collision");
}

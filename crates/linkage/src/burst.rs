/*!
Impacts of one contact that follow each other so fast that it has not opened in between.

In a collapse the bodies of a chain or a heap have infinitely many impacts in a finite time, or at one instant
if they touch. The limit is that their contacts are closed. It is reached where the contacts that have had so
many impacts without opening by a measurable distance are plastic from then on, and plastic contacts at rest
take part in the impacts of their neighbors: impacts one after the other would need infinitely many steps.

A contact is plastic after so many impacts that a body alone, with the same coefficient of restitution, would
have lost all of its energy but rounding. Elastic contacts never are.
*/

use haff_engine::Observer;
use haff_mechanics::Restitution;

use crate::{
    mechanism::Link,
    world::{Burst, World},
};

/// Impacts after which a contact with e = 0 would be plastic.
const FEW: f64 = 16.0;
/// −ln of the part of the speed that the other impacts leave: e^n < 1e-6, and half as much in energies.
const DECADES: f64 = 14.0;

/// Old impacts are forgotten when there are more than this number for each particle.
const MOST: usize = 8;

impl World {
    /// Impacts of a contact without opening, of which the next would be at this approach speed.
    fn impacts_in_burst(&self, link: Link, approach: f64) -> u64 {
        let Some(burst) = self.bursts.get(&link) else { return 0 };
        let opening = burst.speed.max(approach) * self.now.since(burst.at);
        if opening <= self.touch(self.size(link)) { burst.impacts } else { 0 }
    }

    /// Coefficient of restitution of an impact: that of its law, or 0 if it belongs to a burst that has to
    /// end. The impact is counted.
    pub fn coefficient_in_burst(&mut self, link: Link, law: Restitution, approach: f64) -> f64 {
        let mut e = law.coefficient(approach);
        let impacts = self.impacts_in_burst(link, approach) + 1;
        if is_enough(impacts, e) {
            e = 0.0;
        }
        // Most impacts of the past are none of a burst that goes on.
        if self.bursts.len() > MOST * self.count() {
            let (now, period) = (self.now, self.length / self.speed.max(f64::MIN_POSITIVE));
            self.bursts.retain(|_, burst| now.since(burst.at) <= period);
        }
        self.bursts.insert(link, Burst { at: self.now, speed: e * approach, impacts });
        e
    }

    /// Plastic contacts at rest that touch these bodies, directly or through each other; adds the bodies at
    /// their other ends. They take part in a plastic impact of the contact `hit`.
    pub fn plastic_neighbors(
        &mut self,
        bodies: &mut Vec<usize>,
        hit: Link,
        approach: f64,
        observer: &mut dyn Observer,
    ) -> Vec<Link> {
        let is_plastic = |world: &Self, link: Link, rate: f64, slow: f64| {
            link != hit
                && rate.abs() <= slow
                && world.restitution(link).is_some_and(|law| {
                    let e = law.coefficient(approach);
                    e == 0.0 || is_enough(world.impacts_in_burst(link, approach), e)
                })
        };
        let touching = self.touching(bodies, is_plastic, observer);
        touching.into_iter().filter(|link| matches!(link, Link::Pair(..) | Link::Wall(..))).collect()
    }
}

/// Whether a contact is plastic after this number of impacts with this coefficient of restitution.
fn is_enough(impacts: u64, e: f64) -> bool {
    impacts as f64 * (1.0 - e) > FEW * (1.0 - e) + DECADES
}

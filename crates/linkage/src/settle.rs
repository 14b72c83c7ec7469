/*!
Contacts and strings that touch after an event: which of them stay closed, and the velocities that are lost
there.

A contact that is pressed together and would open by less than [`REST_HEIGHT`] of its size before it closes
again cannot be resolved: this is less than the rounding of positions allows. Its series of bounces, of which
there may be infinitely many in a finite time, ends here: the relative velocity of all such contacts is
removed at once, by the smallest change of the velocities in the metric of the masses, so that energy is
never gained.

The height is u²/2a, with the speed u of opening or closing, and the acceleration a at which the contact would
close if its force were removed while all other forces act. Contacts that are not pressed together are
completed only where u itself is rounding ([`World::slow`]).

`contact.rest_speed` completes pressed contacts with any speed below it: heaps of many bodies have very many
impacts at low speeds.
*/

use haff_engine::Observer;
use haff_mechanics::{Bounces, Restitution};

use crate::{
    linear,
    mechanism::{Link, Mechanism, TIE},
    world::{Law, Pending, World},
};

/// A bounce that would rise by less than this part of the contact's size is not resolved.
const REST_HEIGHT: f64 = 1e-13;
/// Rates of rows that hold already are rounding below this part of the speeds.
const HOLDS: f64 = 4.0 * f64::EPSILON;

/// A contact after its impact, with its law of restitution.
pub(crate) type Hit = (Link, Restitution);

/// A mechanism, and which of its rows carry force.
struct Held {
    mechanism: Mechanism,
    active: Vec<bool>,
    /// Accelerations at which the pressed contacts with a velocity would close.
    closing: Vec<f64>,
}

impl World {
    /// The law of restitution at a contact or string; `None` for rods.
    pub fn restitution(&self, link: Link) -> Option<Restitution> {
        let law = match link {
            Link::Pair(i, j) => self.pair_law(i, j),
            Link::Wall(i, wall) => self.wall_law(i, wall),
            Link::Tether(_) => return Some(Restitution::Constant(0.0)),
            Link::Rod(_) | Link::Impact => return None,
        };
        Some(match law {
            Law::Bounce(restitution) => restitution,
            Law::Stick => Restitution::Constant(0.0),
        })
    }

    /// The length that the height of a bounce is compared with \[length\].
    pub fn size(&self, link: Link) -> f64 {
        match link {
            Link::Pair(i, j) => self.contact_distance(i, j),
            Link::Wall(i, _) if self.radius[i] > 0.0 => self.radius[i],
            Link::Tether(p) => self.joints.pendulums[p].length,
            Link::Wall(..) | Link::Rod(_) | Link::Impact => self.length,
        }
    }

    /// Whether a touching contact could stay closed: its rate is rounding, or so small that its bounces might
    /// not be resolved under the largest accelerations of the scene.
    pub fn might_rest(&self, link: Link, rate: f64, slow: f64) -> bool {
        if rate.abs() <= slow.max(self.system.contacts.rest_speed) {
            return true;
        }
        let acceleration = 4.0 * self.speed * self.speed / self.length;
        rate * rate <= 2.0 * acceleration * REST_HEIGHT * self.size(link) && self.ends(link, rate.abs())
    }

    /// Whether a series of bounces that begins at this speed ends.
    fn ends(&self, link: Link, speed: f64) -> bool {
        self.restitution(link).is_some_and(|law| law.bounces(speed).is_some())
    }

    /// Determines which of these links stay closed, and removes the velocities that are not resolved. `hits`:
    /// the contacts of impacts that have just happened. Returns the links that carry force.
    pub fn settle_contacts(
        &mut self,
        part: &[usize],
        mut links: Vec<Link>,
        hits: &[Hit],
        observer: &mut dyn Observer,
    ) -> Vec<Link> {
        let held = loop {
            let (held, resolved) = self.hold(part, &links);
            if resolved.is_empty() {
                break held;
            }
            links.retain(|link| !resolved.contains(link));
        };
        let active = held.mechanism.rows.iter().zip(&held.active);
        let closed = active.filter(|(_, active)| **active).map(|(row, _)| row.link).collect();
        self.remove_velocities(part, held, hits, observer);
        closed
    }

    /// The rows that carry force, and the links among them whose bounces are resolved after all.
    fn hold(&self, part: &[usize], links: &[Link]) -> (Held, Vec<Link>) {
        let mechanism = self.mechanism(part, links, self.now);
        let states = self.anchors(part);
        let tolerance = TIE * mechanism.acceleration_scale(&states);
        let (active, _, forces) = mechanism.active_rows(&states, tolerance);
        let rows = mechanism.row_states(0.0, &states);
        let mut matrix = None;
        let n = rows.len();
        let mut resolved = Vec::new();
        let mut closing = vec![0.0; n];
        for (k, (row, state)) in mechanism.rows.iter().zip(&rows).enumerate() {
            let (v, w) = (row.a.state(0.0, &states).1, row.b.state(0.0, &states).1);
            if !row.unilateral || state.rate.abs() <= self.slow(v, w) {
                continue;
            }
            if !active[k] {
                // It separates; of contacts that still approach slowly the velocity is removed with the
                // others'.
                continue;
            }
            let matrix = matrix.get_or_insert_with(|| mechanism.compliance(&rows));
            let mut unit = vec![0.0; n];
            unit[k] = 1.0;
            let effective_mass = linear::solve(matrix, &unit, &active).0[k];
            closing[k] = forces[k] / effective_mass;
            let height = 0.5 * state.rate * state.rate / closing[k];
            let pressed = forces[k] * matrix[k * n + k] > tolerance;
            let low = height <= REST_HEIGHT * self.size(row.link)
                || state.rate.abs() <= self.system.contacts.rest_speed;
            if !(pressed && effective_mass > 0.0 && low) {
                resolved.push(row.link);
            }
        }
        (Held { mechanism, active, closing }, resolved)
    }

    /// Removes the velocities of active rows, and those of inactive ones at which they approach. Adds the
    /// losses to the sums.
    fn remove_velocities(&mut self, part: &[usize], held: Held, hits: &[Hit], observer: &mut dyn Observer) {
        let Held { mechanism, active, closing } = held;
        let mut states = self.anchors(part);
        let rows = mechanism.row_states(0.0, &states);
        let slow: Vec<f64> = mechanism
            .rows
            .iter()
            .map(|row| self.slow(row.a.state(0.0, &states).1, row.b.state(0.0, &states).1))
            .collect();
        let moves = (0..rows.len()).any(|k| {
            let rate = rows[k].rate;
            let speeds = mechanism.rows[k].a.state(0.0, &states).1.length()
                + mechanism.rows[k].b.state(0.0, &states).1.length();
            if active[k] { rate.abs() > HOLDS * speeds } else { rate < -slow[k] }
        });
        if !moves {
            return;
        }
        let one_sided: Vec<bool> = active.iter().map(|active| !active).collect();
        let rates: Vec<f64> = rows.iter().map(|row| row.rate).collect();
        let matrix = mechanism.compliance(&rows);
        let least = slow.iter().copied().fold(f64::INFINITY, f64::min);
        let (impulses, changed) = linear::complementarity(&matrix, &rates, &one_sided, least);
        self.apply_impulses(part, &mechanism, &rows, &impulses, &mut states);
        let rest: Vec<f64> = mechanism.row_states(0.0, &states).iter().map(|row| -row.rate).collect();
        let (correction, _) = linear::solve(&matrix, &rest, &changed);
        self.apply_impulses(part, &mechanism, &rows, &correction, &mut states);
        for (&body, state) in part.iter().zip(&states) {
            self.anchor[body] = *state;
        }
        // What holds already comes first and loses nothing, then the contact of the impact.
        let law_of = |link: Link| hits.iter().rev().find(|(hit, _)| *hit == link).map(|(_, law)| law);
        let rank = |k: usize| match mechanism.rows[k].link {
            _ if !mechanism.rows[k].unilateral || rates[k].abs() <= slow[k] => 0,
            link if law_of(link).is_some() => 1,
            _ => 2,
        };
        let mut order: Vec<usize> = (0..rows.len()).filter(|&k| changed[k]).collect();
        order.sort_by_key(|&k| (rank(k), k));
        for (k, loss) in linear::losses(&matrix, &rates, &order) {
            let (link, speed) = (mechanism.rows[k].link, rates[k].abs());
            if speed <= slow[k] || !mechanism.rows[k].unilateral {
                continue;
            }
            let series = law_of(link).and_then(|law| law.bounces(speed));
            // The mass that moves at the contact: its energy is the loss.
            let mass = 2.0 * loss / (speed * speed);
            let rest = match series {
                Some(Bounces { speeds, squares }) if closing[k] > 0.0 => Pending {
                    end: self.now.after(2.0 * speed * speeds / closing[k]),
                    speed,
                    impulse: (2.0 * speeds - 1.0) * speed * mass,
                    energy_loss: loss,
                    carnot_energy: squares * loss,
                },
                _ => Pending {
                    end: self.now,
                    speed,
                    impulse: speed * mass,
                    energy_loss: loss,
                    carnot_energy: loss,
                },
            };
            self.pending.insert(link, rest);
            if rest.end == self.now {
                self.settle(link, observer);
            }
        }
    }
}

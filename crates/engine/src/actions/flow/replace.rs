//! Particles taken out of the world, and put into it.

use glam::DVec3;

use crate::state::{State, particle::Particle, population::Arrival, settling::SettlingState};

/// A place in the world: a particle that was there before, by its index, or a new one.
#[derive(Clone, Copy)]
enum Place {
    Kept(u32),
    New(Arrival),
}

/// Values in the order of the places: those that were there before, and new ones.
fn each<T: Copy>(places: &[(u32, Place)], old: &[T], new: impl Fn(&Arrival) -> T) -> Vec<T> {
    let of = |(_, place): &(u32, Place)| match place {
        Place::Kept(i) => old[*i as usize],
        Place::New(arrival) => new(arrival),
    };
    places.iter().map(of).collect()
}

/// Takes the particles with the indices `removed` out of the world, and puts others in; both in ascending
/// order. Only the data of particles are changed, no sums.
pub(super) fn replace(state: &mut State, removed: &[u32], arrivals: &[Arrival]) {
    let State { world, pending, stall, settling, population, .. } = state;
    let (Some(ids), Some(population)) = (world.ids.take(), population) else { return };
    for &i in removed {
        population.counts[ids[i as usize] as usize] = world.particles[i as usize].count;
    }
    let kept = (0..).zip(ids.iter()).filter(|(i, _)| removed.binary_search(i).is_err());
    let mut places: Vec<(u32, Place)> = kept.map(|(i, &id)| (id, Place::Kept(i))).collect();
    places.extend(arrivals.iter().map(|&arrival| (arrival.id, Place::New(arrival))));
    places.sort_by_key(|&(id, _)| id);

    let mut index = vec![None; ids.len()];
    for (new, (_, place)) in places.iter().enumerate() {
        if let &Place::Kept(old) = place {
            index[old as usize] = Some(new as u32);
        }
    }
    let moved = |i: u32| index.get(i as usize).copied().flatten();
    let now = world.now;
    let particle = |arrival: &Arrival| {
        let mut particle = Particle::at(arrival.position, arrival.velocity, now, arrival.class);
        // An own event, so that random numbers are not repeated.
        particle.count = population.counts[arrival.id as usize].wrapping_add(1);
        particle
    };
    world.particles = each(&places, &world.particles, particle).into();
    world.images = each(&places, &world.images, |_| [0; 3]).into();
    if !world.supported.support.is_empty() {
        world.supported.support = each(&places, &world.supported.support, |_| [None; 3]);
    }
    if let Some(spins) = &mut world.spin {
        spins.angular_velocity = each(&places, &spins.angular_velocity, |_| DVec3::ZERO).into();
        let slides = std::mem::take(&mut spins.slides);
        spins.slides = slides.into_iter().filter_map(|(i, slide)| Some((moved(i)?, slide))).collect();
    }
    if let Some(times) = &mut world.laws.contact_times {
        times.replace(|old, never| each(&places, old, |_| never));
    }
    let series = std::mem::take(pending);
    *pending = series.into_iter().filter_map(|(i, rest)| Some((moved(i)?, rest))).collect();
    stall.particles = stall.particles.iter().filter_map(|&i| moved(i)).collect();
    renumber(settling, &places, moved);
    world.movable = (0..world.particles.len() as u32).filter(|&i| world.body(i).inverse_mass != 0.0).count();
    population.entered += arrivals.len() as u64;
    population.left += removed.len() as u64;
    world.ids = Some(places.iter().map(|&(id, _)| id).collect());
}

/// The contacts of asleep grains, by their new indices.
fn renumber(settling: &mut SettlingState, places: &[(u32, Place)], moved: impl Fn(u32) -> Option<u32>) {
    if settling.contacts.is_empty() {
        return;
    }
    let mut old = std::mem::take(&mut settling.contacts);
    let of = |(_, place): &(u32, Place)| match place {
        Place::Kept(i) => {
            let contacts = std::mem::take(&mut old[*i as usize]);
            // Ascending, as before: the order of those that stay does not change.
            contacts.into_iter().filter_map(&moved).collect()
        }
        Place::New(_) => Vec::new(),
    };
    settling.contacts = places.iter().map(of).collect();
}

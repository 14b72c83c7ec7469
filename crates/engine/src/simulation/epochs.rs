//! Epochs of the clock: ticks count from the start of one, and their length is chosen there.

use crate::{
    motion::flights,
    numerics::clock::OLDEST_ANCHOR,
    simulation::run::{RETUNE_BITS, Simulation, open_axes},
    state::stall::Stall,
};

impl Simulation {
    /// Starts the next epoch of the clock at `now` \[ticks\], usually [`EPOCH`]. Chooses a new tick if the
    /// system has become much slower or faster; `speed` is a speed that a particle is about to have
    /// [length/time].
    pub(super) fn start_epoch(&mut self, now: i64, speed: f64) {
        let world = &mut self.state.world;
        world.now = now;
        let extent = world.extent(open_axes(&self.system));
        let exponent = world.exponent_for(extent, world.largest_speed(extent).max(speed));
        let old = world.clock;
        let retune = exponent.abs_diff(old.exponent) >= RETUNE_BITS;
        let moves_all = retune || world.is_damped();
        for i in 0..self.state.world.particles.len() as u32 {
            // Under a drag, anchors are those of an epoch. An anchor that moves, moves to the present: a
            // contact that is predicted from there is not in the past, however it is rounded.
            if moves_all || now - self.state.world.particles[i as usize].time > OLDEST_ANCHOR {
                flights::end(&mut self.state, i, now);
                self.state.world.move_anchor(i);
            }
            self.state.world.particles[i as usize].time -= now;
        }
        if old.drag.is_some() {
            self.state.world.end_damped_epoch(now, extent);
        }
        let slides = self.state.world.spin.iter_mut().flat_map(|spins| spins.end_epoch(&old, now));
        let due = self.state.pending.values_mut().map(|rest| &mut rest.end).chain(slides);
        for time in due.chain([&mut self.state.settling.next, &mut self.state.settling.counted_since]) {
            *time = time.saturating_sub(now);
            if retune {
                let scale = (i64::from(old.exponent) - i64::from(exponent)) as i32;
                *time = (*time as f64 * libm::ldexp(1.0, scale)).round_ties_even() as i64;
            }
        }
        let world = &mut self.state.world;
        world.clock.start_epoch(now);
        if retune {
            world.clock = world.clock.with_exponent(exponent);
        }
        world.set_scale(extent, speed);
        if let Some(times) = &mut world.laws.contact_times {
            times.start_epoch(now, &old, &world.clock);
        }
        world.now = 0;
        self.state.stall = Stall::default();
        self.state.accumulators.counters.epochs += 1;
        let clock = &self.state.world.clock;
        tracing::info!(
            epoch = self.state.accumulators.counters.epochs,
            time = clock.shown(0),
            tick = clock.tick,
            retune,
            "epoch"
        );
        self.rebuild();
    }
}

//! What can be asked of a simulation between two events, its validity, and its reversal.

use glam::DVec3;

use crate::{
    laws::slide,
    measure::{
        frame, sample, take_flights,
        totals::{self, Totals},
    },
    model::{Boundary, NeighborChoice, System},
    motion::flights,
    numerics::error::EngineError,
    report::{BlockCounts, Correlation, Counters, Frame, Sample, Silent, ledger::Ledger},
    simulation::run::Simulation,
    support::overlap::{self, Overlap},
};

impl Simulation {
    /// Present simulated time [time].
    pub fn time(&self) -> f64 {
        self.stop_time.unwrap_or_else(|| self.state.world.clock.shown(self.state.world.now))
    }

    /// Sets the requested time of the present.
    pub(crate) fn set_stop_time(&mut self, time: f64) {
        self.stop_time = Some(time);
    }

    /// All particles now, in the order of the system; with inlets or outlets those, too, that are not there
    /// ([`Frame::present`]).
    pub fn frame(&self) -> Frame {
        let mut frame = frame::frame(&self.state, self.time());
        frame.edges = self.edges();
        frame
    }

    /// Edge vectors of the box now, as in [`Frame::edges`].
    pub fn edges(&self) -> [DVec3; 3] {
        let mut edges = self.state.world.edges(self.state.world.now);
        // Walls move with their edges.
        let walled = |&axis: &usize| self.system.domain.boundary[axis] == Boundary::Wall;
        for axis in (0..3).filter(walled) {
            edges[axis][axis] = self.system.domain.edges(self.time())[axis];
        }
        edges
    }

    /// One row of observables. Pressure and rates are averages since the previous call.
    pub fn sample(&mut self) -> Sample {
        let time = self.time();
        take_flights(&mut self.measurements, &mut self.state);
        let mut sample = sample::sample(&self.system, &self.species, &mut self.state, time);
        for measurement in &mut self.measurements {
            measurement.complete(&self.state, time, &mut sample);
        }
        sample
    }

    /// The correlations in time so far, of those that are measured.
    pub fn correlations(&self) -> Vec<Correlation> {
        self.measurements.iter().flat_map(|measurement| measurement.correlations()).collect()
    }

    /// Present energies and their balance.
    pub fn ledger(&self) -> Ledger {
        totals::ledger(&self.state, &Totals::of(&self.state.world))
    }

    /// The counters so far.
    pub fn counters(&self) -> Counters {
        self.state.accumulators.counters
    }

    /// How several threads have taken events so far.
    pub fn block_counts(&self) -> BlockCounts {
        self.state.blocks
    }

    /// Why one thread takes the events at present, one after the other; `None` if several threads do.
    pub fn serial_reason(&self) -> Option<&'static str> {
        if self.sharing.is_alone() {
            return Some("other processes use the processors");
        }
        self.engine.serial_reason(&self.state)
    }

    /// Finds the deepest present overlap of all close pairs and of particles with walls, and updates
    /// [`Self::max_overlap`]. Returns an error if it is more than rounding (see
    /// [`allowed_overlap`](crate::allowed_overlap)).
    pub fn measure_overlap(&mut self) -> Result<Overlap, EngineError> {
        let found = overlap::deepest(&self.state.world, &self.geometry);
        self.state.accumulators.max_overlap = self.state.accumulators.max_overlap.max(found.deepest.depth);
        match found.beyond.pair {
            Some((i, partner)) => {
                let error = EngineError::Overlap { time: self.time(), i, partner, depth: found.beyond.depth };
                Err(self.with_ids(error))
            }
            None => Ok(found.deepest),
        }
    }

    /// Largest overlap that [`Self::measure_overlap`] has found so far [contact distances].
    pub fn max_overlap(&self) -> f64 {
        self.state.accumulators.max_overlap
    }

    /// Hash of the present position, velocity and image of every particle, and of the position and velocity
    /// of every piston, as 32 hexadecimal digits.
    pub fn state_hash(&self) -> String {
        format!("{:032x}", frame::hash(&self.state.world))
    }

    /// Number of particles that are there.
    pub fn particles(&self) -> usize {
        self.state.world.particles.len()
    }

    /// The simulated system without its bodies; [`Self::frame`] returns their present state.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The partner search in use.
    pub fn neighbors(&self) -> NeighborChoice {
        self.choice.search().choice()
    }

    /// Reverses every velocity and sets all anchors to the present. An elastic system without driven bodies
    /// then retraces its path. Not for a sheared system, whose images would still slide forwards.
    pub fn reverse(&mut self) {
        let now = self.state.world.now;
        let sliding = self.state.world.sliding();
        for &i in &sliding {
            slide::interrupt::<false>(&mut self.state, i, now, &mut Silent);
        }
        let world = &mut self.state.world;
        if let Some(spins) = &mut world.spin {
            for i in 0..spins.angular_velocity.len() {
                spins.angular_velocity[i] = -spins.angular_velocity[i];
            }
        }
        for i in 0..world.particles.len() as u32 {
            flights::end(&mut self.state, i, now);
            let world = &mut self.state.world;
            let (position, mut velocity) = world.state(i, world.now);
            if let Some(wall) = world.carrier(i) {
                let n = world.boundary.walls[wall as usize].normal;
                velocity -= n * velocity.dot(n);
            }
            world.set_anchor(i, position, -velocity, world.now);
            world.wrap_anchor(i);
        }
        self.state.world.reverse_pistons();
        for i in sliding {
            slide::begin(&mut self.state, i, now);
        }
        self.rebuild();
    }

    /// Checks invariants that the engine does not check while it runs: finite velocities, no overlap beyond
    /// `tolerance` [contact distances], a closed energy balance.
    pub fn validate(&mut self, tolerance: f64) -> Result<(), EngineError> {
        let time = self.time();
        let frame = self.frame();
        let is_there = |i: usize| frame.present.get(i).copied().unwrap_or(true);
        let moves_wrongly = |&i: &usize| is_there(i) && !frame.velocity[i].is_finite();
        if let Some(i) = (0..frame.velocity.len()).find(moves_wrongly) {
            return Err(EngineError::Overflow { time, i: i as u32, velocity: frame.velocity[i].to_array() });
        }
        let overlap = self.measure_overlap()?;
        if overlap.depth > tolerance {
            let (i, partner) = overlap.pair.unwrap_or_default();
            let partner = partner.map_or("a wall".to_owned(), |j| format!("particle {j}"));
            let what =
                format!("particle {i} overlaps with {partner} by {:e} contact distances", overlap.depth);
            return Err(EngineError::Inconsistent { time, what });
        }
        let residual = self.ledger().residual;
        if residual.abs() > 1e-9 {
            return Err(EngineError::Inconsistent { time, what: format!("ledger residual {residual:e}") });
        }
        Ok(())
    }
}

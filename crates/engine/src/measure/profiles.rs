//! Profiles along one, two or three axes: densities, velocity, temperature and pressure tensor in the cells
//! of a grid.
//!
//! The fields are those of I. Goldhirsch, Granular Matter 12, 239 (2010), with the cell as the
//! coarse-graining function: what particles have counts in the cell of their center, averaged over several
//! states; what a contact transfers counts in each cell with the part of the line between the centers that is
//! inside, for all contacts of the interval. So the sums over all cells are those of the system. Under shear
//! velocities are relative to the flow at each particle; the velocity of a cell has that of its middle added.
//!
//! Fields of species add up to those of all particles: their temperatures and pressures are relative to the
//! velocity of all particles in the cell, and of what a contact transfers each of the two bodies has half.
//!
//! The states of an interval are taken at times that are spread over it at random, one in each part of equal
//! length. At equal times all of them have the same phase of a wall that oscillates, or of a drive, whose
//! period divides the time between them, and the mean is that of this phase: grains that rise and fall with a
//! floor then have a mean velocity. A state at a random time has every phase with the same probability.

use glam::DVec3;
use haff_mechanics::random::Draw;

use crate::{
    model::{Grid, System, measure::GridAxis},
    numerics::{
        error::EngineError,
        instant::Instant,
        sum::Sum,
        tensor::{Tensor, product},
        words::{Words, fault, put_sums},
    },
    report::{CellFields, Exchange, Observer, Partner, ProfileRow},
    state::{State, deformation::Deformation, sliding_images::SlidingImages, world::World},
};

use super::{Measurement, sample::Species};

/// The fractional part of the golden ratio: its multiples are spread evenly over [0, 1) modulo 1.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Numbers per cell: count, mass, momentum, Σ m v ⊗ v, Σ r ⊗ J.
const COUNT: usize = 0;
const MASS: usize = 1;
const MOMENTUM: usize = 2;
const KINETIC: usize = 5;
const VIRIAL: usize = 14;
const FIELDS: usize = 23;

pub(crate) struct Profile {
    index: usize,
    grid: Grid,
    dimension: usize,
    /// Edge length of periodic axes of the grid, else 0.
    period: Vec<f64>,
    /// Volume of a cell.
    volume: f64,
    /// Numbers of states taken and of rows completed so far.
    taken: u64,
    rows: u64,
    /// Of the random times.
    seed: u64,
    sums: Vec<[Sum; FIELDS]>,
    /// The places of particles: [`Self::sums`] has the cells of all particles, then those of each species of
    /// the grid.
    places: Option<Vec<Option<usize>>>,
    /// Where a contact leaves cells, as fractions of the line between the centers.
    faces: Vec<f64>,
    images: Option<Deformation>,
}

/// The place of each particle of the world among the species of a grid; `None` if it is of another one.
fn places(grid: &Grid, species: &Species, world: &World) -> Option<Vec<Option<usize>>> {
    let place = |i: u32| grid.species.iter().position(|&other| other == species.of(world, i));
    (!grid.species.is_empty()).then(|| (0..world.particles.len() as u32).map(place).collect())
}

impl Profile {
    pub fn new(system: &System, index: usize, grid: &Grid, species: &Species, world: &World) -> Self {
        let periodic = crate::state::periodicity::Periodicity::of(&system.domain).is_periodic;
        let dimension = system.dimension.count();
        let width = |axis: usize| match grid.axes.iter().find(|of_grid| of_grid.axis == axis) {
            Some(axis) => (axis.high - axis.low) / axis.bins as f64,
            None => system.domain.size[axis],
        };
        let period = |axis: &GridAxis| if periodic[axis.axis] { system.domain.size[axis.axis] } else { 0.0 };
        Self {
            index,
            dimension,
            period: grid.axes.iter().map(period).collect(),
            volume: (0..dimension).map(width).product(),
            taken: 0,
            rows: 0,
            seed: system.seed,
            sums: vec![[Sum::default(); FIELDS]; grid.cells() * (1 + grid.species.len())],
            places: places(grid, species, world),
            faces: Vec::new(),
            images: Deformation::of(system),
            grid: grid.clone(),
        }
    }

    /// The cell of a position; `None` outside of the grid.
    fn cell(&self, position: DVec3) -> Option<usize> {
        let mut cell = 0;
        for (axis, period) in self.grid.axes.iter().zip(&self.period) {
            let mut x = position[axis.axis];
            if *period > 0.0 {
                x -= (x / period).floor() * period;
            }
            let bins = axis.bins as f64;
            let mut bin = ((x - axis.low) / (axis.high - axis.low) * bins).floor();
            // The upper end is part of the last cell; along periodic axes only rounding leads there.
            if bin == bins && x <= axis.high {
                bin -= 1.0;
            }
            if !(0.0..bins).contains(&bin) {
                return None;
            }
            cell = cell * axis.bins + bin as usize;
        }
        Some(cell)
    }

    /// Adds a transfer at `time` from `start` along `branch`, to each cell its part of the line; `shares` are
    /// the places of the bodies that change, each of which has the same share of it.
    fn transfer(&mut self, time: f64, [start, branch]: [DVec3; 2], virial: Tensor, shares: &[Option<usize>]) {
        let share = 1.0 / shares.len() as f64;
        let mut faces = std::mem::take(&mut self.faces);
        faces.clear();
        for axis in &self.grid.axes {
            let scale = axis.bins as f64 / (axis.high - axis.low);
            let from = (start[axis.axis] - axis.low) * scale;
            let way = branch[axis.axis] * scale;
            let (first, last) = (from.min(from + way).ceil(), from.max(from + way).floor());
            let mut face = first;
            while face <= last {
                faces.push(((face - from) / way).clamp(0.0, 1.0));
                face += 1.0;
            }
        }
        faces.push(1.0);
        faces.sort_unstable_by(f64::total_cmp);
        let mut left = 0.0;
        for &right in &faces {
            let part = right - left;
            if part > 0.0
                && let Some(cell) = self.cell(self.folded(start + branch * (0.5 * (left + right)), time))
            {
                for (sum, term) in self.sums[cell][VIRIAL..].iter_mut().zip(virial) {
                    sum.add(part * term);
                }
                let cells = self.grid.cells();
                for place in shares.iter().copied().flatten() {
                    let sums = &mut self.sums[(1 + place) * cells + cell][VIRIAL..];
                    for (sum, term) in sums.iter_mut().zip(virial) {
                        sum.add(share * part * term);
                    }
                }
            }
            left = right;
        }
        self.faces = faces;
    }

    /// A position at `time`, in the box along the gradient of a shear.
    fn folded(&self, position: DVec3, time: f64) -> DVec3 {
        match &self.images {
            Some(Deformation { sliding: Some(shear), .. }) => shear.fold(position, Instant::at(time)),
            Some(images) => images.unstretched(position, Instant::at(time)),
            None => position,
        }
    }

    fn shear(&self) -> Option<&SlidingImages> {
        self.images.as_ref()?.sliding.as_ref()
    }

    /// The velocity of the flow in the middle of a cell; zero without shear, or if the grid does not divide
    /// the axis of the gradient.
    fn flow(&self, cell: usize) -> DVec3 {
        let Some(shear) = self.shear() else { return DVec3::ZERO };
        let mut position = DVec3::ZERO;
        let mut rest = cell;
        for axis in self.grid.axes.iter().rev() {
            if axis.axis == shear.gradient {
                let width = (axis.high - axis.low) / axis.bins as f64;
                position[axis.axis] = axis.low + width * ((rest % axis.bins) as f64 + 0.5);
            }
            rest /= axis.bins;
        }
        shear.velocity(position)
    }

    /// Adds the particles at the present.
    fn add_state(&mut self, world: &World) {
        for i in 0..world.particles.len() as u32 {
            let class = world.body(i);
            if class.inverse_mass == 0.0 {
                continue;
            }
            let (mut position, velocity) = world.peculiar(i, world.now);
            if let Some(images) = &self.images {
                position = world.wrap(position, world.now).0;
                position = images.unstretched(position, world.clock.instant(world.now));
            }
            let Some(cell) = self.cell(position) else { continue };
            let momentum = class.mass * velocity;
            let place = self.places.as_ref().and_then(|places| places[i as usize]);
            let of_species = place.map(|place| (1 + place) * self.grid.cells() + cell);
            for cell in [Some(cell), of_species].into_iter().flatten() {
                let sums = &mut self.sums[cell];
                sums[COUNT].add(1.0);
                sums[MASS].add(class.mass);
                for (sum, term) in sums[MOMENTUM..].iter_mut().zip(momentum.to_array()) {
                    sum.add(term);
                }
                for (sum, term) in sums[KINETIC..].iter_mut().zip(product(momentum, velocity)) {
                    sum.add(term);
                }
            }
        }
    }

    /// The row of the interval that ends at `time`. Starts the next interval.
    fn row(&mut self, time: f64) -> ProfileRow {
        let cells = self.grid.cells();
        let flows: Vec<DVec3> = (0..cells).map(|cell| self.flow(cell)).collect();
        let mut all = CellFields::default();
        let mut species = vec![CellFields::default(); self.grid.species.len()];
        for (cell, sheared) in flows.into_iter().enumerate() {
            let u = self.add_cell(cell, None, sheared, &mut all);
            for (place, fields) in species.iter_mut().enumerate() {
                self.add_cell((1 + place) * cells + cell, Some(u), sheared, fields);
            }
        }
        self.sums.fill([Sum::default(); FIELDS]);
        ProfileRow { profile: self.index, time, step: 0, all, species }
    }

    /// Adds the fields of a cell; those of a species are relative to the velocity `u` of all particles in it.
    /// `sheared` is the velocity of the flow. Returns the velocity of the particles.
    fn add_cell(&self, cell: usize, u: Option<DVec3>, sheared: DVec3, fields: &mut CellFields) -> DVec3 {
        let d = self.dimension;
        let (states, span) = (self.grid.samples as f64, self.grid.interval);
        let sums = &self.sums[cell];
        let of = |k: usize| sums[k].value() / states;
        let mass = of(MASS);
        let momentum = DVec3::new(of(MOMENTUM), of(MOMENTUM + 1), of(MOMENTUM + 2));
        // NaN in an empty cell.
        let velocity = momentum / mass;
        // Σ m v ⊗ v less this is Σ m (v − u) ⊗ (v − u).
        let flow = match u {
            _ if mass == 0.0 => [0.0; 9],
            None => product(momentum, velocity),
            Some(u) => {
                let (first, second, third) =
                    (product(momentum, u), product(u, momentum), product(mass * u, u));
                std::array::from_fn(|k| first[k] + second[k] - third[k])
            }
        };
        fields.density.push(of(COUNT) / self.volume);
        fields.mass_density.push(mass / self.volume);
        fields.velocity.push(velocity + sheared);
        let mut thermal = 0.0;
        for k in (0..9).filter(|k| k / 3 < d && k % 3 < d) {
            let kinetic = of(KINETIC + k) - flow[k];
            if k % 4 == 0 {
                thermal += kinetic;
            }
            let virial = sums[VIRIAL + k].value() / span;
            fields.pressure.push((kinetic + virial) / self.volume);
        }
        fields.temperature.push(thermal / (d as f64 * of(COUNT)));
        velocity
    }

    /// Time of state number `k` \[time\], from 0: multiples of the interval are exact.
    ///
    /// Times in the parts of an interval are a random number and multiples of the golden ratio, modulo 1:
    /// each is uniform in its part, and a few of them are already even in the phase of a motion whose period
    /// divides the parts.
    fn state_time(&self, k: u64) -> f64 {
        let Grid { samples, interval, spread, .. } = self.grid;
        let (row, part) = (k / samples, k % samples);
        let place = if spread {
            let first = Draw::new(self.seed, u32::MAX, row).uniform();
            (first + part as f64 * GOLDEN).fract()
        } else {
            1.0
        };
        (row as f64 + (part as f64 + place) / samples as f64) * interval
    }

    /// Whether all states of the present row have been taken.
    fn is_full(&self) -> bool {
        self.taken == (self.rows + 1) * self.grid.samples
    }

    /// Time of the next state, or of the end of a row that has all of them \[time\].
    fn next_time(&self) -> f64 {
        if self.is_full() { (self.rows + 1) as f64 * self.grid.interval } else { self.state_time(self.taken) }
    }
}

impl Measurement for Profile {
    fn exchange(&mut self, exchange: &Exchange) {
        if let (Partner::Particle { branch, position, .. }, Some(change)) =
            (exchange.partner, exchange.changes.first())
        {
            let impulse = -change.mass * (change.after - change.before);
            let mut shares = [None; 2];
            if let Some(places) = &self.places {
                for (share, change) in shares.iter_mut().zip(exchange.changes) {
                    *share = places[change.i as usize];
                }
            }
            let shares = &shares[..exchange.changes.len().min(2)];
            self.transfer(exchange.time, [position, branch], product(branch, impulse), shares);
        }
    }

    fn renumber(&mut self, species: &Species, world: &World) {
        self.places = places(&self.grid, species, world);
    }

    fn next(&self, state: &State) -> i64 {
        state.world.clock.ticks(self.next_time())
    }

    fn take(&mut self, state: &State, observer: &mut dyn Observer) {
        if !self.is_full() {
            self.taken += 1;
            self.add_state(&state.world);
        }
        // The last state may be at the end of the row.
        if self.is_full() && self.next(state) <= state.world.now {
            let counters = state.accumulators.counters;
            let step = counters.collisions + counters.wall_collisions;
            let row = self.row(self.next_time());
            self.rows += 1;
            observer.profile(ProfileRow { step, ..row });
        }
    }

    fn save(&self, words: &mut Vec<u64>) {
        words.extend([self.taken, self.rows]);
        self.sums.iter().for_each(|sums| put_sums(words, sums));
    }

    fn load(&mut self, words: &mut Words, time: f64) -> Result<(), EngineError> {
        let [taken, rows] = [words.take()?, words.take()?];
        let samples = self.grid.samples;
        let most = rows.checked_add(1).and_then(|rows| rows.checked_mul(samples));
        let fits = most.is_some_and(|most| (most - samples..=most).contains(&taken)) && {
            (self.taken, self.rows) = (taken, rows);
            // What was done last: the end of a row, or a state.
            let ended = taken == rows * samples;
            let last = if ended { rows as f64 * self.grid.interval } else { self.state_time(taken - 1) };
            let rounding = 1e-9 * self.grid.interval;
            last - rounding <= time && time <= self.next_time() + rounding
        };
        if !fits {
            let what = format!("{taken} states and {rows} rows of a profile do not fit to the time {time}");
            return Err(fault(&what));
        }
        self.sums.iter_mut().try_for_each(|sums| words.sums(sums))
    }
}

/*!
Coordinates of the filter, and the span of time for which they are valid.

Coordinates are integers, 2³² of them to an edge of the box along a periodic axis: the difference of two
coordinates, taken modulo 2³², belongs to the nearest image, at no cost and for any box. A bounded axis is
treated as a periodic one with a longer edge, so that particles at its two ends are not neighbors; an open one
as a periodic one with a very long edge, at whose ends particles may be neighbors, but do not touch.

Lengths are in units of the largest contact distance, times in units of the *span*. A [`CompactParticle`]
contains the position that its particle would have had at the beginning of the span on its present path, and
its displacement within the span. The displacement of every particle is limited: another image of a pair
cannot become the nearest one within a span, and single precision is sufficient.

Under gravity the frame of the filter falls from rest since the beginning of the span. All particles that fall
have straight paths in it, and differences of positions are the same as in the box. Lists do not fall: for
their skin spheres the fall of the frame is added. A particle that does not fall, because its mass is infinite
or it rests on a wall, has no straight path in this frame: filters leave it out, and its pairs are predicted
exactly.
*/

use glam::DVec3;
use haff_mechanics::{duration, free_flight, free_flight_velocity};
use haff_neighbors::Axis;

use crate::{
    model::features::Features,
    search::{
        case::Reason,
        compact::{CompactParticle, HEADROOM, LONGEST_SPAN, NEAREST, PERIOD, coordinate},
    },
    state::world::World,
};

use super::moving::{LARGEST_CHANGE, Motion, MovingFrame};

/// Largest displacement of a particle within a span, for contact distances that differ by at most
/// [`SIZE_RATIO`] [largest contact distances]. Its rounding error, about 10⁻⁶ of it, is far below [`MARGIN`].
const MAX_DISPLACEMENT: f64 = 12.0;
/// See [`MAX_DISPLACEMENT`], which is less for larger ratios, so that it is the same for the smallest
/// particles.
const SIZE_RATIO: f64 = 2.0;
/// Length after which coordinates repeat along an open axis [smallest contact distances].
const OPEN: f64 = 16_384.0;
/// Least limit of the displacement with which this scheduler is profitable [largest contact distances]:
/// smaller boxes would need too many spans.
const MIN_DISPLACEMENT: f64 = 0.1;
/// Fraction by which contact distances are widened. It covers the rounding of single precision.
const MARGIN: f64 = 1e-4;
/// With more than this many margins too many pairs would pass the filter.
const WIDEST: f64 = 50.0;
/// Upper bound of the rounding error of r·v, in units of the largest r times the largest v.
const NOISE: f64 = 4e-6;

/// Coordinates and the present span.
#[derive(Debug, Clone)]
pub(super) struct FilterFrame {
    /// The largest contact distance [length].
    pub sigma: f64,
    /// Lengths after which coordinates repeat [length].
    pub period: [f64; 3],
    /// Whether an axis is open: positions can then be any number of periods from the box.
    is_open: bool,
    /// Coordinates per unit of length, and largest contact distances per coordinate.
    pub per_length: [f64; 3],
    pub unit: [f32; 3],
    /// Largest possible distance of two particles of a list [largest contact distances].
    reach: f64,
    /// Largest displacement of a particle within a span for this box [largest contact distances].
    max_displacement: f64,
    /// Begin and end of the present span [ticks], its length [time], and spans per tick.
    pub begin: i64,
    pub end: i64,
    step: f64,
    pub per_tick: f64,
    /// Square of the largest displacement allowed within the present span [largest contact distances²].
    pub limit2: f32,
    /// Square of the widened contact distance of two of the largest particles [largest contact distances²].
    pub sigma2: f32,
    /// Upper bound of the rounding error of r·v [largest contact distances²/span].
    pub noise: f32,
    /// Factor by which contact distances are widened.
    margin: f64,
    /// Acceleration of the particles that fall [length/time²].
    gravity: DVec3,
    /// Fall of the frame within the span, from rest [largest contact distances].
    pub fall: [f32; 3],
    /// Longest time for which a path differs from its chord by no more than lists allow [spans].
    pub longest_chord: f32,
    /// The largest such difference [largest contact distances].
    bend: f64,
    /// The frame of a box that deforms, and what filters and lists read of it.
    pub moving: Option<MovingFrame>,
    pub motion: Motion,
}

/// The box and the particles for which a [`FilterFrame`] is made.
pub(super) struct Extent {
    pub axes: [Axis; 3],
    /// Edges of the box [length].
    pub size: DVec3,
    /// How far particles can be beyond the lower and the upper face, along each bounded axis [length].
    pub beyond: [[f64; 2]; 3],
    /// Largest and smallest contact distance [length].
    pub contact: [f64; 2],
    /// Largest distance of two particles of a list [length].
    pub reach: f64,
    pub gravity: DVec3,
    /// Largest difference of a path from its chord that lists allow [largest contact distances].
    pub bend: f64,
    pub moving: Option<MovingFrame>,
}

/// The largest distance of two particles of a list \[length\] that the edge of an axis allows, with
/// `beyond` as in [`Extent`], in a box whose edges change by a part of up to `change` in a span.
pub(super) fn longest_reach(axis: Axis, edge: f64, beyond: [f64; 2], sigma: f64, change: f64) -> f64 {
    // More than the least displacement, so that spans are not much shorter than they need to be.
    let displaced = 2.0 * (1.0 + MARGIN) * MIN_DISPLACEMENT * (1.0 + change) * sigma;
    match axis {
        Axis::Periodic => NEAREST * edge - displaced,
        Axis::Bounded => (NEAREST * (edge + beyond[0] + beyond[1]) - displaced) / (1.0 - NEAREST),
        Axis::Open | Axis::Flat => f64::INFINITY,
    }
}

impl FilterFrame {
    /// Coordinates for a box and its particles.
    ///
    /// # Errors
    /// The box is too small or too large, or sizes differ too much.
    pub fn new(extent: &Extent) -> Result<Self, Reason> {
        let &Extent { axes, size, beyond, contact: [sigma, least], reach, gravity, bend, moving } = extent;
        let (mut period, mut per_length, mut unit) = (size.to_array(), [1.0; 3], [1.0; 3]);
        let mut max_displacement = MAX_DISPLACEMENT * (SIZE_RATIO * least / sigma).min(1.0);
        if max_displacement < MIN_DISPLACEMENT {
            return Err(Reason::new("sizes differ too much for single precision"));
        }
        let mut longest: f64 = 0.0;
        for axis in 0..3 {
            match axes[axis] {
                Axis::Flat => {
                    period[axis] = 1.0;
                    continue;
                }
                Axis::Periodic => {}
                Axis::Bounded => period[axis] += reach + beyond[axis][0] + beyond[axis][1],
                Axis::Open => period[axis] = (OPEN * least).max(64.0 * reach),
            }
            let edge = period[axis];
            per_length[axis] = PERIOD / edge;
            unit[axis] = (1.0 / (per_length[axis] * sigma)) as f32;
            // The distance of two particles grows at up to twice the speed of one.
            let mut most = 0.5 * (NEAREST * edge - reach) / sigma;
            if let Some(moving) = &moving {
                let tilt = if axis == 0 { moving.largest_tilt() } else { 0.0 };
                let room = NEAREST * edge * moving.axes.shortest() - reach * (1.0 + tilt);
                most = 0.5 * room / sigma / (1.0 + LARGEST_CHANGE);
            }
            max_displacement = max_displacement.min(most);
            longest = longest.max(edge / least);
        }
        // The last term covers the rounding of coordinates.
        let margin = 1.0 + MARGIN + 4.0 * longest / PERIOD;
        if max_displacement < MIN_DISPLACEMENT {
            return Err(Reason::new("an edge is too short for images of lists"));
        }
        if margin >= 1.0 + WIDEST * MARGIN {
            return Err(Reason::new("an edge is too long for coordinates of 32 bits"));
        }
        Ok(Self {
            sigma,
            period,
            is_open: axes.contains(&Axis::Open),
            per_length,
            unit,
            reach: reach / sigma,
            max_displacement,
            begin: 0,
            end: 0,
            step: 0.0,
            per_tick: 0.0,
            limit2: 0.0,
            sigma2: (margin * margin) as f32,
            noise: 0.0,
            margin,
            gravity,
            fall: [0.0; 3],
            longest_chord: f32::INFINITY,
            bend,
            moving,
            motion: Motion::default(),
        })
    }

    /// Begins a span at `now` [ticks], not before the present time. If lists are `made`, it is the first
    /// one for these lists.
    pub fn begin<F: Features>(&mut self, world: &World, now: i64, made: bool) {
        if F::DEFORMS {
            self.begin_moving::<F>(world, now, made);
            return;
        }
        let fastest = if F::GRAVITY {
            let falling = (0..world.particles.len() as u32).filter(|&i| world.falls(i));
            let squares = falling.map(|i| world.flight::<F>(i, now).1.length_squared());
            squares.fold(0.0, f64::max).sqrt() * HEADROOM
        } else {
            let squares = world.particles.iter().map(|particle| particle.velocity.length_squared());
            squares.fold(0.0, f64::max).sqrt() * HEADROOM
        };
        let most = self.max_displacement * self.sigma;
        let pull = if F::GRAVITY { self.gravity.length() } else { 0.0 };
        // Without motion the time is infinite, and the span has its largest length. A particle that has
        // fallen with the box, because it bounces, moves relative to the frame by what the frame has
        // gained.
        let time = duration(most, fastest, 2.0 * pull);
        let ticks = (time * world.clock.per_time).clamp(1.0, LONGEST_SPAN) as i64;
        self.begin = now;
        self.end = self.begin + ticks;
        self.step = ticks as f64 * world.clock.tick;
        self.per_tick = 1.0 / ticks as f64;
        let displacement = (fastest + pull * self.step) * self.step / self.sigma;
        let limit = displacement.min(self.max_displacement) as f32;
        self.limit2 = limit * limit;
        self.noise = (NOISE * self.reach) as f32 * limit;
        if F::GRAVITY {
            let fall = self.gravity * (0.5 * self.step * self.step / self.sigma);
            self.fall = [fall.x as f32, fall.y as f32, fall.z as f32];
            // A parabola differs from its chord by a quarter of its fall.
            self.longest_chord = (4.0 * self.bend / fall.length()).sqrt() as f32;
        }
    }

    /// [`Self::begin`] in a box that deforms.
    fn begin_moving<F: Features>(&mut self, world: &World, now: i64, made: bool) {
        let Some(mut moving) = self.moving else { return };
        moving.begin(world, now, &mut self.period, made);
        for axis in 0..3 {
            // A flat axis has one coordinate.
            if self.per_length[axis] == 1.0 {
                continue;
            }
            self.per_length[axis] = PERIOD / self.period[axis];
            self.unit[axis] = (1.0 / (self.per_length[axis] * self.sigma)) as f32;
        }
        let square = |i: u32| {
            let (position, velocity) = world.flight::<F>(i, now);
            let [_, v] = moving.path(position, velocity);
            v.iter().map(|v| v * v).sum::<f64>()
        };
        let squares = (0..world.particles.len() as u32).map(square);
        let fastest = squares.fold(0.0, f64::max).sqrt() * HEADROOM;
        let time = duration(self.max_displacement * self.sigma, fastest, 0.0).min(moving.longest());
        let ticks = (time * world.clock.per_time).clamp(1.0, LONGEST_SPAN) as i64;
        (self.begin, self.end) = (now, now + ticks);
        self.step = ticks as f64 * world.clock.tick;
        self.per_tick = 1.0 / ticks as f64;
        let limit = (fastest * self.step / self.sigma).min(self.max_displacement);
        self.limit2 = (limit * limit) as f32;
        // The displacement in space contains the tilt, and the flow over the distance.
        let displacement = limit * (1.0 + moving.largest_tilt()) + LARGEST_CHANGE * self.reach;
        self.noise = (NOISE * self.reach * displacement) as f32;
        self.longest_chord = moving.longest_chord(self.step, limit, self.bend);
        self.motion = moving.motion(self.step, &self.period);
        self.moving = Some(moving);
    }

    /// The fraction of the span that has passed at time `now`.
    #[inline(always)]
    pub fn fraction(&self, now: i64) -> f32 {
        ((now - self.begin) as f64 * self.per_tick) as f32
    }

    /// The compact particle of particle i.
    #[inline(always)]
    pub fn compact<F: Features>(&self, world: &World, i: u32) -> CompactParticle {
        if F::DEFORMS && !F::GRAVITY {
            return self.moving::<F>(world, i);
        }
        if self.is_plain::<F>() { self.straight::<F>(world, i) } else { self.falling::<F>(world, i) }
    }

    /// Whether all particles have a [straight](Self::straight) flight near the box.
    #[inline(always)]
    pub fn is_plain<F: Features>(&self) -> bool {
        !F::GRAVITY && !F::DEFORMS && !self.is_open
    }

    /// [`Self::compact`] without gravity and open axes. On its own, because it is then compiled to vector
    /// instructions (lists.md).
    #[inline(always)]
    pub fn straight<F: Features>(&self, world: &World, i: u32) -> CompactParticle {
        let particle = &world.particles[i as usize];
        let back = (self.begin - particle.time) as f64 * world.clock.tick;
        let (position, velocity) = (particle.position.to_array(), particle.velocity.to_array());
        let mut compact = self.without_path::<F>(world, i);
        let scale = self.step / self.sigma;
        for axis in 0..3 {
            compact.x[axis] = self.coordinate(axis, position[axis] + velocity[axis] * back);
            compact.v[axis] = (velocity[axis] * scale) as f32;
        }
        compact
    }

    /// [`Self::compact`] in general.
    #[inline]
    fn falling<F: Features>(&self, world: &World, i: u32) -> CompactParticle {
        if F::GRAVITY && !world.falls(i) {
            return self.fixed::<F>(world, i);
        }
        if F::DEFORMS {
            return self.moving::<F>(world, i);
        }
        let particle = &world.particles[i as usize];
        let back = (self.begin - particle.time) as f64 * world.clock.tick;
        let gravity = if F::GRAVITY { self.gravity } else { DVec3::ZERO };
        let position = free_flight(particle.position, particle.velocity, gravity, back).to_array();
        let displacement = free_flight_velocity(particle.velocity, gravity, back) * (self.step / self.sigma);
        CompactParticle {
            x: if self.is_open {
                self.coordinates(position)
            } else {
                [0, 1, 2].map(|axis| self.coordinate(axis, position[axis]))
            },
            v: displacement.to_array().map(|v| v as f32),
            ..self.without_path::<F>(world, i)
        }
    }

    /// [`Self::compact`] in a box that deforms.
    #[inline(always)]
    fn moving<F: Features>(&self, world: &World, i: u32) -> CompactParticle {
        let Some(moving) = &self.moving else { return self.straight::<F>(world, i) };
        let particle = &world.particles[i as usize];
        let back = (self.begin - particle.time) as f64 * world.clock.tick;
        let [position, velocity] =
            moving.path(particle.position + particle.velocity * back, particle.velocity);
        let scale = self.step / self.sigma;
        CompactParticle {
            x: if self.is_open {
                self.coordinates(position)
            } else {
                [0, 1, 2].map(|axis| self.coordinate(axis, position[axis]))
            },
            v: velocity.map(|v| (v * scale) as f32),
            ..self.without_path::<F>(world, i)
        }
    }

    /// The radius and the event counter of particle i.
    #[inline(always)]
    fn without_path<F: Features>(&self, world: &World, i: u32) -> CompactParticle {
        let radius = if F::UNIFORM { 0.5 } else { world.class(i).radius / self.sigma * self.margin };
        let count = world.particles[i as usize].count;
        CompactParticle { radius: radius as f32, count, ..CompactParticle::default() }
    }

    /// What filters read of a particle that does not fall: they find no contact with it. The position is the
    /// present one.
    #[cold]
    #[inline(never)]
    fn fixed<F: Features>(&self, world: &World, i: u32) -> CompactParticle {
        let position = world.flight::<F>(i, world.now).0.to_array();
        CompactParticle {
            x: self.coordinates(position),
            v: CompactParticle::SENTINEL.v,
            ..self.without_path::<F>(world, i)
        }
    }

    /// Whether the present span allows the displacement of a particle with this position and velocity at
    /// `ticks`.
    #[inline(always)]
    pub fn allows<F: Features>(
        &self,
        world: &World,
        (position, velocity): (DVec3, DVec3),
        ticks: i64,
    ) -> bool {
        let scale = self.step / self.sigma;
        let elapsed = (ticks - self.begin) as f64 * world.clock.tick;
        let velocity = match &self.moving {
            Some(moving) if F::DEFORMS => moving.path(position - velocity * elapsed, velocity)[1],
            _ if F::GRAVITY => (velocity - self.gravity * elapsed).to_array(),
            _ => velocity.to_array(),
        };
        let mut compact = CompactParticle::default();
        for axis in 0..3 {
            compact.v[axis] = (velocity[axis] * scale) as f32;
        }
        compact.is_within(self.limit2)
    }

    /// The coordinate of a position along an axis [length], at most some periods from the box.
    #[inline(always)]
    fn coordinate(&self, axis: usize, position: f64) -> i32 {
        coordinate(position * self.per_length[axis])
    }

    /// The coordinates of any position [length].
    #[inline(never)]
    pub fn coordinates(&self, position: [f64; 3]) -> [i32; 3] {
        [0, 1, 2].map(|axis| {
            let period = self.period[axis];
            self.coordinate(axis, position[axis] - (position[axis] / period).floor() * period)
        })
    }
}

/*!
Coordinates of the filter, and the span of time that they are good for.

Coordinates are integers, 2^32 of them to a periodic edge: the difference of two, taken modulo 2^32, is the
nearest image at no cost, whatever the box. A bounded edge is treated as a periodic one that is longer by so
much that particles at its ends are no neighbors. Lengths are in the largest contact distance, times in
*spans*: a [`CompactParticle`] tells where the present path of its particle would have been at the beginning of the
span, and how far it goes within it. No particle moves so far that another image of a pair could come to be
the nearest, nor further than single precision can tell.
*/

use haff_neighbors::{Axis, Geometry};

use crate::{
    compact::{CompactParticle, HEADROOM, LONGEST_SPAN, NEAREST, PERIOD, coordinate},
    features::Features,
    particles::World,
};

/// The farthest that particles may go within a span [largest contact distances]: 10^-6 of that is far below
/// [`MARGIN`].
const FARTHEST: f64 = 12.0;
/// Least way within a span that is worth while [largest contact distances].
const LEAST_WAY: f64 = 0.25;
/// Part by which contact distances are widened, for all that single precision and coordinates round.
const MARGIN: f64 = 1e-4;
/// What the rounding of r·v may be, in units of the greatest r and v.
const NOISE: f64 = 4e-6;

/// Coordinates and the present span.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    /// The largest contact distance [length].
    sigma: f64,
    /// What coordinates repeat after [length].
    pub period: [f64; 3],
    /// Coordinates per length, and largest contact distances per coordinate.
    pub per_length: [f64; 3],
    pub unit: [f32; 3],
    /// Distance beyond which listed particles never are [largest contact distances].
    reach: f64,
    /// The farthest that the box lets particles go within a span [largest contact distances].
    farthest: f64,
    /// The present span [ticks], its length [time], and spans per tick.
    pub begin: i64,
    pub end: i64,
    step: f64,
    pub per_tick: f64,
    /// Square of the greatest allowed displacement in it.
    pub limit2: f32,
    /// Square of the widened contact distance of two of the largest; what the rounding of r·v may be.
    pub sigma2: f32,
    pub noise: f32,
    margin: f64,
}

impl Frame {
    /// Coordinates for a box in which particles up to `reach` apart are looked at [length]; `None` if it is
    /// too small, or open.
    pub fn new(geometry: &Geometry, reach: f64) -> Option<Self> {
        let sigma = geometry.reach;
        let (mut period, mut per_length, mut unit) = (geometry.size.to_array(), [1.0; 3], [1.0; 3]);
        let mut farthest = FARTHEST;
        let mut longest: f64 = 0.0;
        for axis in 0..3 {
            match geometry.axes[axis] {
                kind @ (Axis::Periodic | Axis::Bounded) => {
                    if kind == Axis::Bounded {
                        period[axis] += reach;
                    }
                    let edge = period[axis];
                    per_length[axis] = PERIOD / edge;
                    unit[axis] = (1.0 / (per_length[axis] * sigma)) as f32;
                    // Two particles come apart at twice the speed of one.
                    farthest = farthest.min(0.5 * (NEAREST * edge - reach) / sigma);
                    longest = longest.max(edge / sigma);
                }
                Axis::Flat => {}
                Axis::Open => return None,
            }
        }
        let margin = 1.0 + MARGIN + 4.0 * longest / PERIOD;
        (farthest >= LEAST_WAY && margin < 1.0 + 2.0 * MARGIN).then_some(Self {
            sigma,
            period,
            per_length,
            unit,
            reach: reach / sigma,
            farthest,
            begin: 0,
            end: 0,
            step: 0.0,
            per_tick: 0.0,
            limit2: 0.0,
            sigma2: (margin * margin) as f32,
            noise: 0.0,
            margin,
        })
    }

    /// Begins a span at the present.
    pub fn begin(&mut self, world: &World) {
        let squares = world.particles.iter().map(|particle| particle.velocity.length_squared());
        let fastest = squares.fold(0.0, f64::max).sqrt() * HEADROOM;
        // Without motion any span will do.
        let ticks =
            (self.farthest * self.sigma / fastest * world.clock.per_time).clamp(1.0, LONGEST_SPAN) as i64;
        self.begin = world.now;
        self.end = self.begin + ticks;
        self.step = ticks as f64 * world.clock.tick;
        self.per_tick = 1.0 / ticks as f64;
        let limit = (fastest * self.step / self.sigma).min(self.farthest) as f32;
        self.limit2 = limit * limit;
        self.noise = (NOISE * self.reach) as f32 * limit;
    }

    /// The present, as a part of the span.
    #[inline(always)]
    pub fn part(&self, now: i64) -> f32 {
        ((now - self.begin) as f64 * self.per_tick) as f32
    }

    /// What the filter is to know of particle i.
    #[inline(always)]
    pub fn compact<F: Features>(&self, world: &World, i: u32) -> CompactParticle {
        let particle = &world.particles[i as usize];
        let back = (self.begin - particle.time) as f64 * world.clock.tick;
        let (position, velocity) = (particle.position.to_array(), particle.velocity.to_array());
        let radius = if F::UNIFORM { 0.5 } else { world.class(i).radius / self.sigma * self.margin };
        let mut compact =
            CompactParticle { radius: radius as f32, count: particle.count, ..CompactParticle::default() };
        let scale = self.step / self.sigma;
        for axis in 0..3 {
            compact.x[axis] = self.coordinate(axis, position[axis] + velocity[axis] * back);
            compact.v[axis] = (velocity[axis] * scale) as f32;
        }
        compact
    }

    /// The coordinate of a position along an axis [length].
    #[inline(always)]
    pub fn coordinate(&self, axis: usize, position: f64) -> i32 {
        coordinate(position * self.per_length[axis])
    }
}

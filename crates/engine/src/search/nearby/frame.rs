/*!
Coordinates of the filter, and the span of time for which they are valid.

Coordinates are integers, 2³² of them to an edge of the box along a periodic axis: the difference of two
coordinates, taken modulo 2³², belongs to the nearest image, at no cost and for any box. A bounded axis is
treated as a periodic one with a longer edge, so that particles at its two ends are not neighbors.

Lengths are in units of the largest contact distance, times in units of the *span*. A [`CompactParticle`]
contains the position that its particle would have had at the beginning of the span on its present path, and
its displacement within the span. The displacement of every particle is limited: another image of a pair
cannot become the nearest one within a span, and single precision is sufficient.
*/

use glam::DVec3;
use haff_neighbors::Axis;

use crate::{
    model::features::Features,
    search::{
        case::Reason,
        compact::{CompactParticle, HEADROOM, LONGEST_SPAN, NEAREST, PERIOD, coordinate},
    },
    state::world::World,
};

/// Largest displacement of a particle within a span [largest contact distances]. Its rounding error, about
/// 10⁻⁶ of it, is far below [`MARGIN`].
const MAX_DISPLACEMENT: f64 = 12.0;
/// Least limit of the displacement with which this scheduler is profitable [largest contact distances]:
/// smaller boxes would need too many spans.
const MIN_DISPLACEMENT: f64 = 0.25;
/// Fraction by which contact distances are widened. It covers the rounding of single precision.
const MARGIN: f64 = 1e-4;
/// Upper bound of the rounding error of r·v, in units of the largest r times the largest v.
const NOISE: f64 = 4e-6;

/// Coordinates and the present span.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    /// The largest contact distance [length].
    sigma: f64,
    /// Lengths after which coordinates repeat [length].
    pub period: [f64; 3],
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
}

impl Frame {
    /// Coordinates for a box with these axes and edges \[length\], in which particles touch at `sigma` at
    /// most and those of a list are at most `reach` apart [length].
    ///
    /// # Errors
    /// The box is too small, too large, or open along an axis.
    pub fn new(axes: [Axis; 3], size: DVec3, sigma: f64, reach: f64) -> Result<Self, Reason> {
        let (mut period, mut per_length, mut unit) = (size.to_array(), [1.0; 3], [1.0; 3]);
        let mut max_displacement = MAX_DISPLACEMENT;
        let mut longest: f64 = 0.0;
        for axis in 0..3 {
            match axes[axis] {
                kind @ (Axis::Periodic | Axis::Bounded) => {
                    if kind == Axis::Bounded {
                        period[axis] += reach;
                    }
                    let edge = period[axis];
                    per_length[axis] = PERIOD / edge;
                    unit[axis] = (1.0 / (per_length[axis] * sigma)) as f32;
                    // The distance of two particles grows at up to twice the speed of one.
                    max_displacement = max_displacement.min(0.5 * (NEAREST * edge - reach) / sigma);
                    longest = longest.max(edge / sigma);
                }
                Axis::Flat => {}
                Axis::Open => return Err(Reason::new("an axis is open")),
            }
        }
        // The last term covers the rounding of coordinates.
        let margin = 1.0 + MARGIN + 4.0 * longest / PERIOD;
        if max_displacement < MIN_DISPLACEMENT {
            return Err(Reason::new("an edge is too short for images of lists"));
        }
        if margin >= 1.0 + 2.0 * MARGIN {
            return Err(Reason::new("an edge is too long for coordinates of 32 bits"));
        }
        Ok(Self {
            sigma,
            period,
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
        })
    }

    /// Begins a span at `now` [ticks], not before the present time.
    pub fn begin(&mut self, world: &World, now: i64) {
        let squares = world.particles.iter().map(|particle| particle.velocity.length_squared());
        let fastest = squares.fold(0.0, f64::max).sqrt() * HEADROOM;
        // Without motion the quotient is infinite, and the span has its largest length.
        let ticks = (self.max_displacement * self.sigma / fastest * world.clock.per_time)
            .clamp(1.0, LONGEST_SPAN) as i64;
        self.begin = now;
        self.end = self.begin + ticks;
        self.step = ticks as f64 * world.clock.tick;
        self.per_tick = 1.0 / ticks as f64;
        let limit = (fastest * self.step / self.sigma).min(self.max_displacement) as f32;
        self.limit2 = limit * limit;
        self.noise = (NOISE * self.reach) as f32 * limit;
    }

    /// The fraction of the span that has passed at time `now`.
    #[inline(always)]
    pub fn fraction(&self, now: i64) -> f32 {
        ((now - self.begin) as f64 * self.per_tick) as f32
    }

    /// The compact particle of particle i.
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

    /// Whether the present span allows the displacement of a particle with this velocity.
    #[inline(always)]
    pub fn allows(&self, velocity: DVec3) -> bool {
        let scale = self.step / self.sigma;
        let velocity = velocity.to_array();
        let mut compact = CompactParticle::default();
        for axis in 0..3 {
            compact.v[axis] = (velocity[axis] * scale) as f32;
        }
        compact.is_within(self.limit2)
    }

    /// The coordinate of a position along an axis [length].
    #[inline(always)]
    pub fn coordinate(&self, axis: usize, position: f64) -> i32 {
        coordinate(position * self.per_length[axis])
    }
}

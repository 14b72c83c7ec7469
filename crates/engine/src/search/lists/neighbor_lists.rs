/*!
Neighbor lists in the coordinates of the [frame](super::frame).

Every particle has a *reference position*: its position when its list was made, or a little ahead of that. The
*skin sphere* of the particle is the sphere around it whose radius is half of the skin. Two particles are in
each other's list if their reference positions are closer than contact distance and skin: they cannot touch
before one of them has left its skin sphere. When a particle leaves its skin sphere, its list is updated: its
reference position moves to the particle, and its own list and those of the partners lost and gained change.
All other lists remain.

Neighbors are found by differences of integer coordinates, so lists contain no periodic images, and nothing
changes when a particle is wrapped into the box.
*/

mod exits;
mod members;

use glam::DVec3;
use haff_neighbors::{Array, Axis, Geometry, prefetch_at, with_huge_pages};

use crate::{
    model::features::Features,
    search::{blocks::Grid, compact::CompactParticle, parallel},
};

use super::{
    bins::Layout,
    frame::FilterFrame,
    levels::Levels,
    plan::{Plan, STRAIGHT},
    sets::{LANES, MASK_BITS},
};

/// Margin of the distance at which pairs are listed. It covers rounding in single precision [largest contact
/// distances].
const SLACK: f32 = 1e-3;
/// Number of lists of `overflow` that are lent to an alias.
const LENT: usize = 4 * MASK_BITS;

/// A reference position, and the number of members of its particle's list.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(16))]
struct Reference {
    x: [i32; 3],
    members: u32,
}

/// A wall: its unit normal, and its largest coordinate along this normal [largest contact distances].
#[derive(Debug, Clone, Copy)]
struct ListedPlane {
    normal: DVec3,
    offset: f64,
    /// Of another shape, which is tested instead.
    shape: Option<haff_neighbors::Plane>,
}

/// The walls of a geometry. A wall that moves on and on, or whose normal has a component along an axis on
/// which coordinates stand for several places, is near every particle.
fn planes(geometry: &Geometry, axes: [Axis; 3]) -> Vec<ListedPlane> {
    let plane = |plane: &haff_neighbors::Plane| {
        let is_everywhere = plane.sweep == f64::INFINITY || !plane.repeats(axes);
        let offset = if is_everywhere {
            f64::INFINITY
        } else {
            (plane.point.dot(plane.normal) + plane.sweep) / geometry.reach
        };
        let shape = (plane.surface.is_some() && !is_everywhere).then_some(*plane);
        ListedPlane { normal: plane.normal, offset, shape }
    };
    geometry.planes.iter().map(plane).collect()
}

/// Neighbor lists.
#[derive(Debug, Clone, Default)]
pub(super) struct Lists {
    /// Half of the skin, which is the radius of a skin sphere [largest contact distances].
    half_skin: f32,
    /// Square of the distance from the reference position at which a particle leaves its skin sphere [largest
    /// contact distances²].
    exit2: f32,
    /// Largest contact distances per coordinate.
    unit: [f32; 3],
    /// The tilt with which distances are measured in a sheared box.
    tilt: f32,
    /// By how much contact distances can be larger in these lengths [largest contact distances].
    strain: f32,
    /// The same in double precision, for distances from walls.
    scale: [f64; 3],
    /// Positions above this belong to particles below the lower face [largest contact distances].
    highest: [f64; 3],
    /// Lengths after which coordinates repeat [largest contact distances].
    period: [f64; 3],
    references: Array<Reference>,
    bins: Levels,
    /// The lists, `stride` words each. The words after the members of a list contain [`Self::sentinel`]. If a
    /// list has more than `stride` members, it is in `overflow`, and its first word here is the index there.
    words: Array<u32>,
    stride: usize,
    overflow: Array<Vec<u32>>,
    /// Indices in `overflow` that no list uses.
    free_overflow: Vec<u32>,
    /// Working space of [`Self::renew`].
    found: Vec<u32>,
    planes: Vec<ListedPlane>,
    /// The largest contact distance \[length\].
    sigma: f64,
    /// Whether a particle can touch a wall before it leaves its skin sphere; empty without walls.
    near_wall: Array<bool>,
    /// Number of lists of `overflow` that are lent to aliases.
    lent: usize,
    /// How often lists have been lengthened.
    growths: usize,
    /// Whether this is an alias for one thread of several, which uses only memory that has been lent to it.
    is_alias: bool,
}

impl Lists {
    /// Lists for a plan. All `particles` must have been copied at the beginning of the frame's span.
    pub fn new<F: Features>(plan: &Plan, geometry: &Geometry, particles: &Array<CompactParticle>) -> Self {
        let &Plan { ref frame, half_skin, strain, axes, edges, highest, spacing, members, .. } = plan;
        let count = particles.len() - 1;
        let mut lists = Self {
            half_skin: half_skin as f32,
            exit2: {
                let exit = if F::GRAVITY || F::DEFORMS { STRAIGHT * half_skin } else { half_skin };
                (exit * exit) as f32
            },
            unit: frame.unit,
            tilt: frame.moving.map_or(0.0, |moving| moving.list_tilt as f32),
            strain: strain as f32,
            scale: frame.per_length.map(|per_length| 1.0 / (per_length * geometry.reach)),
            highest,
            period: frame.period.map(|period| period / geometry.reach),
            planes: planes(geometry, axes),
            sigma: geometry.reach,
            bins: {
                let skin = 2.0 * (half_skin + f64::from(SLACK)) + strain;
                let tilt = frame.moving.map_or(0.0, |moving| moving.list_tilt);
                let layout = Layout { edges, unit: frame.unit, tilt, skin, spacing };
                if F::UNIFORM {
                    Levels::new::<true>(&layout, particles)
                } else {
                    Levels::new::<false>(&layout, particles)
                }
            },
            ..Self::default()
        };
        let mut references = with_huge_pages(count);
        references
            .extend(particles.part(0..count).iter().map(|compact| Reference { x: compact.x, members: 0 }));
        lists.references = references.into();
        if !lists.planes.is_empty() {
            lists.near_wall =
                particles.part(0..count).iter().map(|compact| lists.is_near_plane(compact.x)).collect();
        }
        let mut sample = Vec::new();
        let mut lengths: Vec<usize> = (0..count)
            .step_by((count / 1000).max(1))
            .map(|i| lists.find::<F, false, false>(i as u32, particles, &mut sample))
            .collect();
        lengths.sort_unstable();
        // Particles that start on a lattice have no fluctuations of density yet, so these are added to the
        // mean.
        let most = lengths.get(lengths.len() * 99 / 100).copied().unwrap_or(0);
        lists.stride = most.max((members + 1.5 * members.sqrt()) as usize).max(1).next_multiple_of(LANES);
        let stride = lists.stride;
        let mut words = with_huge_pages(count * stride);
        words.resize(count * stride, count as u32);
        let built = parallel::map_parts_mut(&mut words, stride, &Vec::new, &|found, i, words| {
            let length = lists.find::<F, false, false>(i as u32, particles, found);
            let list = &found[..length];
            if length > words.len() {
                return (length as u32, Some(list.to_vec()));
            }
            words[..length].copy_from_slice(list);
            (length as u32, None)
        });
        lists.words = words.into();
        for (i, (length, list)) in built.into_iter().enumerate() {
            lists.references[i].members = length;
            if let Some(list) = list {
                lists.move_to_overflow(i as u32, &list);
            }
        }
        lists
    }

    /// Allocates what is lent to this number of aliases: an allocation while there are aliases would move the
    /// memory that they use.
    pub fn reserve(&mut self, aliases: usize) {
        let more = (aliases * LENT).saturating_sub(self.free_overflow.len());
        if more > 0 {
            let first = self.overflow.len() as u32;
            self.free_overflow.extend(first..first + more as u32);
            self.overflow.change(|overflow| overflow.resize(overflow.len() + more, Vec::new()));
        }
        self.bins.reserve(aliases);
    }

    /// The same lists for another thread, with [reserved](Self::reserve) memory for some further members
    /// until it is [taken back](Self::take_back).
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`]: no thread changes reference positions, lists and bins that another one uses.
    pub unsafe fn alias(&mut self) -> Self {
        let kept = self.free_overflow.len().saturating_sub(LENT);
        self.lent += self.free_overflow.len() - kept;
        // SAFETY: guaranteed by the caller.
        unsafe {
            Self {
                references: self.references.alias(),
                bins: self.bins.alias(),
                words: self.words.alias(),
                overflow: self.overflow.alias(),
                near_wall: self.near_wall.alias(),
                planes: self.planes.clone(),
                sigma: self.sigma,
                free_overflow: self.free_overflow.split_off(kept),
                found: Vec::new(),
                is_alias: true,
                ..*self
            }
        }
    }

    /// Takes back the memory that an alias has not used.
    pub fn take_back(&mut self, alias: &mut Self) {
        if self.growths == alias.growths {
            self.lent = self.lent.saturating_sub(LENT);
            self.free_overflow.append(&mut alias.free_overflow);
        }
        self.bins.take_back(&mut alias.bins);
    }

    /// Distance from the faces of a block that its events need, so that they do not read what those of
    /// another block change [largest contact distances].
    pub fn reach(&self) -> f32 {
        // An update reads its bin and one on each side, and changes its bin: half of the distance of two
        // updates, each with its particle up to half of the skin from a reference position.
        let bins = 1.5 * (self.bins.widest(self.unit) + self.half_skin);
        // What is prefetched is also read for events at a face: the list of a partner, one contact distance
        // beyond. An update changes lists of particles whose reference positions are up to a contact distance
        // and the skin from its own one; each of the two is up to half of the skin from its particle.
        bins.max(2.0 * (1.0 + self.strain) + 4.0 * self.half_skin + SLACK)
    }

    /// The grid of blocks: that of bins. `None` if a bin holds several places of the box.
    pub fn grid(&self) -> Option<Grid> {
        self.bins.grid(self.unit)
    }

    /// The index that pads lists: that of [`CompactParticle::SENTINEL`].
    fn sentinel(&self) -> u32 {
        self.references.len() as u32
    }

    /// The list of i, padded to whole vectors.
    #[inline(always)]
    pub fn of(&self, i: u32) -> &[u32] {
        let (start, members) = (i as usize * self.stride, self.references[i as usize].members as usize);
        if members > self.stride {
            return &self.overflow[self.words[start] as usize];
        }
        self.words.part(start..start + members.next_multiple_of(LANES))
    }

    /// Whether there are walls.
    #[inline(always)]
    pub fn has_walls(&self) -> bool {
        !self.planes.is_empty()
    }

    /// Whether particle i can touch a wall before it leaves its skin sphere. There must be walls.
    #[inline(always)]
    pub fn is_near_wall(&self, i: u32) -> bool {
        self.near_wall[i as usize]
    }

    /// Whether the largest particle, on the surface of the skin sphere around a reference position, can touch
    /// a wall.
    fn is_near_plane(&self, reference: [i32; 3]) -> bool {
        let position = |axis: usize| {
            let position = f64::from(reference[axis] as u32) * self.scale[axis];
            if position > self.highest[axis] { position - self.period[axis] } else { position }
        };
        let reference = DVec3::new(position(0), position(1), position(2));
        let reach = f64::from(self.half_skin + self.bins.largest_radius() + SLACK);
        self.planes.iter().any(|plane| match &plane.shape {
            None => reference.dot(plane.normal) - plane.offset <= reach,
            Some(shape) => shape.is_near(reference * self.sigma, 0.0, reach * self.sigma),
        })
    }

    /// Prefetches the list and the reference position of i.
    #[inline(always)]
    pub fn prefetch(&self, i: u32) {
        let start = i as usize * self.stride;
        prefetch_at(&self.words, start);
        prefetch_at(&self.words, start + self.stride - 1);
        prefetch_at(&self.references, i as usize);
    }

    /// Moves the reference position of i to the present position of the particle, and further ahead on its
    /// path by the fraction `ahead` of half of the skin. Updates all lists that change. `fraction` is the
    /// fraction of the span that has passed. Returns false, and changes nothing, if an alias would need
    /// memory for it.
    #[inline(always)]
    pub fn renew<F: Features, const VECTORS: bool>(
        &mut self,
        i: u32,
        frame: &FilterFrame,
        particles: &Array<CompactParticle>,
        fraction: f32,
        ahead: f32,
    ) -> bool {
        let compact = &particles[i as usize];
        let mut v = compact.v;
        if F::GRAVITY {
            for axis in 0..3 {
                v[axis] += 2.0 * frame.fall[axis] * fraction;
            }
        }
        let mut speed = dot(v, v).sqrt();
        if F::DEFORMS {
            v = frame.motion.velocity(compact.v, fraction);
            let mut measured = v;
            for axis in 0..3 {
                measured[axis] *= frame.motion.to_lists[axis];
            }
            measured[0] += self.tilt * measured[1];
            speed = dot(measured, measured).sqrt();
        }
        let ahead = if speed > 0.0 { ahead * self.half_skin / speed } else { 0.0 };
        let mut position = [0; 3];
        let path = if F::DEFORMS { frame.motion.path(compact.v, fraction) } else { compact.v };
        for axis in 0..3 {
            let moved = if F::DEFORMS {
                path[axis] + v[axis] * ahead
            } else if F::GRAVITY {
                // The fall so far, and along the present velocity.
                (compact.v[axis] + frame.fall[axis] * fraction) * fraction + v[axis] * ahead
            } else {
                compact.v[axis] * (fraction + ahead)
            };
            let unit = if F::DEFORMS { frame.unit[axis] } else { self.unit[axis] };
            let displacement = f64::from(moved) / f64::from(unit);
            position[axis] = compact.x[axis].wrapping_add(displacement as i64 as i32);
        }
        self.set_reference::<F, VECTORS>(i, position, particles)
    }

    /// The reference position of i.
    pub fn reference(&self, i: u32) -> [i32; 3] {
        self.references[i as usize].x
    }

    /// Moves the reference position of i, and updates all lists that change. Returns false, and changes
    /// nothing, if an alias would need memory for it.
    #[inline(always)]
    pub fn set_reference<F: Features, const VECTORS: bool>(
        &mut self,
        i: u32,
        position: [i32; 3],
        particles: &Array<CompactParticle>,
    ) -> bool {
        let before = std::mem::replace(&mut self.references[i as usize].x, position);
        self.bins.remove::<VECTORS>(i, before);
        let mut found = std::mem::take(&mut self.found);
        let length = self.find::<F, VECTORS, true>(i, particles, &mut found);
        let has_room = self.bins.insert::<VECTORS>(i, position);
        let is_moved = has_room && self.replace::<VECTORS>(i, &found, length);
        self.found = found;
        if !is_moved {
            if has_room {
                self.bins.remove::<VECTORS>(i, position);
            }
            self.bins.insert::<VECTORS>(i, before);
            self.references[i as usize].x = before;
            return false;
        }
        if !self.planes.is_empty() {
            self.near_wall[i as usize] = self.is_near_plane(position);
        }
        true
    }

    /// Writes the neighbors of i to the start of `found` and returns their number. `found` can be longer; its
    /// length is a multiple of [`LANES`]. `REMOVED`: the reference position of i has been removed from the
    /// bins.
    #[inline(always)]
    fn find<F: Features, const VECTORS: bool, const REMOVED: bool>(
        &self,
        i: u32,
        particles: &Array<CompactParticle>,
        found: &mut Vec<u32>,
    ) -> usize {
        let own = self.references[i as usize].x;
        let skin = 2.0 * self.half_skin + SLACK + if F::DEFORMS { self.strain } else { 0.0 };
        let radius = if F::UNIFORM { 0.5 } else { particles[i as usize].radius };
        let bins = &self.bins;
        let count = match (F::UNIFORM, F::DEFORMS) {
            (true, false) => bins.near::<VECTORS, true, false>(i, own, radius, skin, found),
            (false, false) => bins.near::<VECTORS, false, false>(i, own, radius, skin, found),
            (true, true) => bins.near::<VECTORS, true, true>(i, own, radius, skin, found),
            (false, true) => bins.near::<VECTORS, false, true>(i, own, radius, skin, found),
        };
        if F::UNIFORM && REMOVED {
            return count;
        }
        let mut kept = 0;
        for k in 0..count {
            let j = found[k];
            let near = F::UNIFORM || {
                let reach = (particles[i as usize].radius + particles[j as usize].radius) + skin;
                let mut d = [0.0; 3];
                for axis in 0..3 {
                    d[axis] =
                        self.references[j as usize].x[axis].wrapping_sub(own[axis]) as f32 * self.unit[axis];
                }
                if F::DEFORMS {
                    d[0] += self.tilt * d[1];
                }
                dot(d, d) < reach * reach
            };
            found[kept] = j;
            kept += usize::from(near && j != i);
        }
        kept
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

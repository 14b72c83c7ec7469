/*!
Shapes of walls: cylinders, spheres, cones, finite planes and triangle meshes, as [`haff_mechanics::Surface`].

| module | is |
|---|---|
| [`part`] | parts of a surface, and the search for the first contact with one of them |
| [`mod@sphere`] | a sphere, from inside or outside |
| [`revolution`] | cylinders and cones, without end, closed by flat ends, or open |
| [`rectangle`] | a finite plane; in two dimensions a line of finite length |
| [`mod@mesh`] | triangles, found by a tree; whether they close a volume, and on which side a position is |

A shape consists of *parts* whose distances change smoothly along a path: their second derivative is bounded
from below. A corner between two parts is the contact with each of them; nothing is rounded off there.
Contacts are found by [`haff_mechanics::first_contact_bounded`] for each part, so that none is missed, however
short.

To add a shape, implement [`Part`] for its parts, and [`haff_mechanics::Surface`] as `rectangle.rs` does;
the scene gets its keys in `haff-scene`.
*/

#![forbid(unsafe_code)]

pub mod mesh;
pub mod part;
pub mod rectangle;
pub mod revolution;
pub mod sphere;

pub use mesh::{Mesh, MeshError, Triangle};
pub use part::{Part, Side};
pub use rectangle::Rectangle;
pub use revolution::Revolution;
pub use sphere::Sphere;

/// The README's examples are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/*!
Rest: grains in contact come to rest under gravity after finitely many events. A grain at rest has no events
until an impact wakes it.

A series of bounces that lose a constant fraction of their speed has infinitely many bounces in a finite time.
For a single grain on a flat wall the series is completed in closed form (`series::come_to_rest`). For grains
on grains there is no closed form. The scene therefore states a speed v, `contact.rest_speed`:

* *Repeated contacts*: a contact that follows the last contact of either body within 10 v/g is elastic if the
  approach is slower than v/8, and otherwise never reduces the speed below v/8. Impacts then cannot accumulate
  at one time. For walls this holds only for grains whose last contact was with another grain or itself
  repeated, not for a grain that bounces on a wall alone. Bodies that gravity presses together separate at
  least at the speed that they would gain by falling towards each other for v/128g; without this, grains that
  start in contact have no height from which to bounce.
* *Settling scan*: every v/g a scan finds the largest set of grains that are slower than v/2 and supported. A
  grain is supported if its weight lies in the cone of the normals of its contacts with grains of the set,
  grains at rest, fixed bodies and walls that do not move. Two bodies are in contact if their gap is below
  v²/4g, twice the height to which a speed of v/2 can rise. Because the set is the largest, it contains
  arches, whose stones support each other only together. Because the lowest grain must be supported by
  something outside the set, no group of grains floats.
* *Jams*: grains pushed into a space without any room would collide without end. Too many contacts within a
  very short time are a jam. All grains with a contact in that time lose the velocity with which they press on
  each other and on immovable bodies, in one plastic impact on all their contacts at once. A settling scan
  follows immediately.
* Grains of the set become *asleep*: zero velocity, infinite mass, no entry in the calendar.
* An impact faster than v, or any impact of a moving wall or driven body, *wakes* a grain, and with it all
  grains that are no longer supported.

Neglected: whether the contact forces of all grains together can balance their weights. A grain at rest bears
any load, as if there were friction, until an impact wakes it.
*/

mod jam;
pub(crate) mod scan;
pub(crate) mod settle;

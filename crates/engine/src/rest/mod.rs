/*!
Rest: grains in contact come to rest under gravity after finitely many events, cost nothing then, and wake
when hit.

Bounces that lose a constant part of their speed are infinitely many in a finite time. A flat wall under a
single grain completes them in closed form (`resolve::come_to_rest`); between grains nothing does. So a speed
v, `contact.rest_speed`, is stated:

* *Slow and soon*: contacts that follow the last one of either body sooner than 10 v/g are elastic below v/8,
  and take no more than down to it, so that impacts cannot accumulate. For walls that holds for grains that
  have met another grain, not for one that is alone with them. What is then left without height, because it
  has been let go where it touches, parts at least as fast as it falls in v/128g.
* *Settling scan*: every v/g the largest set of grains is looked for that are slower than v/2 and stand, each on
  those of the set, on grains at rest, on fixed bodies and on walls that do not move: its weight lies in the
  cone of the normals of contacts narrower than v²/4g, twice what a speed of v/2 can rise. As the set is the
  largest, arches are found, whose stones stand only together; as its lowest grain must stand on something
  else, nothing floats.
* *Jams*: grains driven into a place without any room would collide without end. Too many contacts at what is
  nearly one time are a jam: those who had them lose the velocity with which they press on each other and on
  what cannot give way, in one plastic impact on all their contacts together, and a settling scan follows at once.
* The grains of the set are *asleep*: velocity zero, infinite mass, no entry in the calendar.
* An impact faster than v, or any of a moving wall or driven body, *wakes* a grain, and with it those that no
  longer stand.

What is neglected: whether the contacts of all grains together can balance their weights. A grain at rest
holds any load, as with friction, until an impact shakes it.
*/

pub(crate) mod contact;
mod jam;
mod settle;
pub(crate) mod standing;
pub(crate) mod state;
mod support;
pub(crate) mod thresholds;

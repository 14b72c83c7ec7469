//! Angular velocities and energies of rotation at a time.

use glam::DVec3;

use crate::{numerics::total::total, state::world::World};

impl World {
    /// The angular velocity of particle i at `ticks` [1/time]; zero without spin.
    pub fn angular_velocity(&self, i: u32, ticks: i64) -> DVec3 {
        let Some(spins) = &self.spin else { return DVec3::ZERO };
        let start = spins.angular_velocity[i as usize] * self.spin_decay(ticks);
        match spins.slides.get(&i) {
            Some(slide) => start + slide.spin_change(&self.clock, ticks),
            None => start,
        }
    }

    /// Sets the angular velocity of particle i at `ticks`. Returns the energy that this gives to it.
    pub fn set_spin(&mut self, i: u32, spin: DVec3, ticks: i64) -> f64 {
        let (class, decay) = (*self.body(i), self.spin_decay(ticks));
        let Some(spins) = &mut self.spin else { return 0.0 };
        let before = decay * std::mem::replace(&mut spins.angular_velocity[i as usize], spin / decay);
        0.5 * class.moment_of_inertia(&spins.inertia) * (spin - before).dot(spin + before)
    }

    /// Energy and angular momentum of the rotation of particle i at `ticks`; zero for a body of infinite
    /// mass.
    pub fn rotation(&self, i: u32, ticks: i64) -> (f64, DVec3) {
        let Some(spins) = &self.spin else { return Default::default() };
        let body = self.body(i);
        if body.inverse_mass == 0.0 {
            return Default::default();
        }
        let (moment, spin) = (body.moment_of_inertia(&spins.inertia), self.angular_velocity(i, ticks));
        (0.5 * moment * spin.length_squared(), moment * spin)
    }

    /// Kinetic energy of the rotation of all bodies of finite mass at the present, and their angular momentum
    /// about their own centers.
    pub fn all_rotation(&self) -> (f64, DVec3) {
        if self.spin.is_none() {
            return Default::default();
        }
        let [energy, x, y, z] = total(self.particles.len(), |i| {
            let (energy, momentum) = self.rotation(i, self.now);
            [energy, momentum.x, momentum.y, momentum.z]
        });
        (energy, DVec3::new(x, y, z))
    }
}

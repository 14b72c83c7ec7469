use glam::DVec3;

use crate::{
    laws::event::{Pause, PhysicalEvent},
    model::features::{Features, Polydisperse},
    numerics::error::EngineError,
    report::{Observer, Silent},
    state::State,
};

use super::two_spheres;

/// A particle is caught: it loses all of its velocity.
#[derive(Debug, Clone, Copy)]
struct Capture(u32);

impl PhysicalEvent for Capture {
    fn participants(self) -> ([u32; 2], Option<u32>) {
        ([self.0, self.0], None)
    }

    fn resolve<F: Features, const EVENTS: bool>(
        self,
        state: &mut State,
        time: i64,
        _observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        let (position, velocity) = state.world.state(self.0, time);
        let energy = 0.5 * state.world.class(self.0).mass * velocity.length_squared();
        state.world.particles[self.0 as usize].set_anchor(position, DVec3::ZERO, time);
        // A plastic impact: Carnot's energy of the velocity lost equals the loss.
        state.accumulators.add_losses(state.world.clock.shown(time), energy, energy);
        Ok(Vec::new())
    }

    fn pause<F: Features>(self, state: &mut State, _time: i64) -> Option<Pause> {
        state.is_at_rest().then_some(Pause::Rest)
    }
}

#[test]
fn a_captured_particle_is_at_rest_and_the_balance_has_its_energy() {
    let State { world, .. } = &two_spheres().state;
    let mut simulation = two_spheres();
    let time = world.clock.ticks(0.25);
    let event = Capture(1);
    event.resolve::<Polydisperse, false>(&mut simulation.state, time, &mut Silent).expect("no overflow");
    assert_eq!(simulation.state.world.state(1, time), (DVec3::new(5.75, 2.0, 2.0), DVec3::ZERO));
    assert_eq!(simulation.state.accumulators.dissipated(), 0.5);
    assert_eq!(event.pause::<Polydisperse>(&mut simulation.state, time), None);
    Capture(0).resolve::<Polydisperse, false>(&mut simulation.state, time, &mut Silent).expect("no overflow");
    assert_eq!(event.pause::<Polydisperse>(&mut simulation.state, time), Some(Pause::Rest));
}

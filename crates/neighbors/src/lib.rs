//! Partner search for event-driven particles: cells and all pairs.

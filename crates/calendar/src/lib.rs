//! Event calendars: a fast ladder queue and a plain reference.

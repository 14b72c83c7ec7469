//! What another crate adds to a process, with the names by which scenes have it.

use std::sync::{Mutex, PoisonError};

/// A law, or something else that another crate adds, with the name and the parameters by which scenes have
/// it.
#[derive(Debug)]
pub struct Named<T: ?Sized> {
    name: String,
    parameters: String,
    value: Box<T>,
}

/// Equal names and parameters mean the same.
impl<T: ?Sized> PartialEq for Named<T> {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.parameters) == (&other.name, &other.parameters)
    }
}

impl<T: ?Sized> Named<T> {
    /// The name in scenes.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What has this name.
    #[must_use]
    pub fn get(&self) -> &T {
        &self.value
    }
}

/// All of one kind in the process. They are copied into systems, so that they are never freed; equal ones are
/// kept once.
#[derive(Debug, Default)]
pub struct NamedOnce<T: ?Sized + 'static>(Mutex<Vec<&'static Named<T>>>);

impl<T: ?Sized> NamedOnce<T> {
    /// None so far.
    #[must_use]
    pub const fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// The one with this name and these parameters, as text; `value` if it is new.
    pub fn of(&self, name: &str, parameters: &str, value: Box<T>) -> &'static Named<T> {
        let named = Named { name: name.to_owned(), parameters: parameters.to_owned(), value };
        // A panic elsewhere cannot leave the list incomplete.
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = all.iter().find(|known| ***known == named) {
            return known;
        }
        let named: &'static Named<T> = Box::leak(Box::new(named));
        all.push(named);
        named
    }
}

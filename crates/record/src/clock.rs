//! The columns `step` and `time`, and texts in attributes.

use std::str::FromStr;

use hdf5::{Group, Location, types::VarLenUnicode};

use crate::series::{SERIES_CHUNK, Series, Storage};

/// `step` and `time`, shared by all elements sampled together.
#[derive(Debug)]
pub(crate) struct Clock {
    pub step: Series,
    pub time: Series,
}

impl Clock {
    pub fn create(group: &Group) -> hdf5::Result<Self> {
        let storage = Storage::plain(SERIES_CHUNK, &[]);
        Ok(Self {
            step: Series::create::<i64>(group, "step", &[], &storage)?,
            time: Series::create_real(group, "time", &[], &storage)?,
        })
    }

    pub fn open(group: &Group) -> hdf5::Result<Self> {
        Ok(Self {
            step: Series::open(group, "step")?.expect(&[])?,
            time: Series::open(group, "time")?.expect(&[])?,
        })
    }

    pub fn rows(&self) -> usize {
        self.step.rows().min(self.time.rows())
    }

    /// Fails unless rows can be added after the first `kept` ones.
    pub fn check_growth(&self, kept: usize) -> hdf5::Result<()> {
        self.step.check_growth::<i64>(kept)?;
        self.time.check_growth::<f64>(kept)
    }

    pub fn truncate(&mut self, rows: usize) -> hdf5::Result<()> {
        self.step.resize(rows)?;
        self.time.resize(rows)
    }
}

pub(crate) fn write_text_attribute(place: &Location, name: &str, value: &str) -> hdf5::Result<()> {
    place.new_attr::<VarLenUnicode>().create(name)?.write_scalar(&text(value)?)
}

/// A string as HDF5 stores it.
pub(crate) fn text(text: &str) -> hdf5::Result<VarLenUnicode> {
    VarLenUnicode::from_str(text).map_err(|error| format!("text with a NUL character: {error}").into())
}

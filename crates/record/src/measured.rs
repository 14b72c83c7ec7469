//! Profiles and correlations: the groups `profiles` and `correlations`.

use haff_engine::{CORRELATIONS, CellFields, Correlation, CorrelationKind, Correlations, Grid, ProfileRow};
use hdf5::Group;

use crate::{
    clock::{Clock, write_text_attribute},
    declared::read_attribute,
    series::{SERIES_CHUNK, Series, Storage},
};

/// Largest number of values in a chunk of a profile.
const PROFILE_CHUNK: usize = 1 << 16;
/// Rows per chunk of a correlation: more than the lags of any run, so that no chunk is ever freed.
const LAGS: usize = 1024;

/// Attribute with the index of a profile in the scene.
const INDEX: &str = "index";

/// A field of profiles.
struct Field {
    name: &'static str,
    unit: &'static str,
    /// Shape of the value in a cell, in d dimensions.
    shape: fn(usize) -> Vec<usize>,
    values: fn(&CellFields) -> Vec<f64>,
}

const FIELDS: [Field; 5] = [
    Field {
        name: "density",
        unit: "1/length^d",
        shape: |_| Vec::new(),
        values: |cells| cells.density.clone(),
    },
    Field {
        name: "mass_density",
        unit: "mass/length^d",
        shape: |_| Vec::new(),
        values: |cells| cells.mass_density.clone(),
    },
    Field {
        name: "velocity",
        unit: "length/time",
        shape: |_| vec![3],
        values: |cells| cells.velocity.iter().flat_map(glam::DVec3::to_array).collect(),
    },
    Field {
        name: "temperature",
        unit: "energy",
        shape: |_| Vec::new(),
        values: |cells| cells.temperature.clone(),
    },
    Field {
        name: "pressure",
        unit: "energy/length^d",
        shape: |d| vec![d, d],
        values: |cells| cells.pressure.clone(),
    },
];

/// What the names of the fields of species begin with.
const OF_SPECIES: &str = "species_";

/// Shapes of a row's fields, on a grid in d dimensions: of all particles, then of species, if it has any,
/// with the species first.
pub(crate) fn row_shapes(grid: &Grid, dimension: usize) -> Vec<Vec<usize>> {
    let cells = || grid.axes.iter().map(|axis| axis.bins);
    let of_all = FIELDS.iter().map(|field| cells().chain((field.shape)(dimension)).collect());
    let species = grid.species.len();
    let of_species = FIELDS.iter().filter(|_| species > 0).map(|field| {
        std::iter::once(species).chain(cells()).chain((field.shape)(dimension)).collect::<Vec<usize>>()
    });
    of_all.chain(of_species).collect()
}

/// Names of the fields in the order of [`row_shapes`], with their fields.
fn fields(of_species: bool) -> impl Iterator<Item = (String, &'static Field)> {
    let of_all = FIELDS.iter().map(|field| (field.name.to_owned(), field));
    let more = FIELDS.iter().filter(move |_| of_species);
    of_all.chain(more.map(|field| (format!("{OF_SPECIES}{}", field.name), field)))
}

/// Rows of one profile.
#[derive(Debug)]
pub(crate) struct Profile {
    series: Vec<Series>,
    clock: Clock,
    /// Steps and times of rows whose values have been written, but not flushed.
    pending: Vec<(i64, f64)>,
}

/// The shape of a chunk for rows of this shape: at most [`PROFILE_CHUNK`] values.
pub(crate) fn chunk(width: &[usize]) -> Vec<usize> {
    let mut shape = width.to_vec();
    while shape.iter().product::<usize>() > PROFILE_CHUNK
        && let Some(longest) = shape.iter_mut().max()
    {
        *longest = longest.div_ceil(2);
    }
    let rows = (PROFILE_CHUNK / shape.iter().product::<usize>().max(1)).clamp(1, SERIES_CHUNK);
    std::iter::once(rows).chain(shape).collect()
}

impl Profile {
    fn create(all: &Group, index: usize, grid: &Grid, dimension: usize) -> hdf5::Result<Self> {
        let group = all.create_group(&grid.name())?;
        group.new_attr::<u32>().create(INDEX)?.write_scalar(&(index as u32))?;
        let mut series = Vec::with_capacity(FIELDS.len());
        let mut clock = None;
        let has_species = !grid.species.is_empty();
        if has_species {
            write_species(&group, &grid.species)?;
        }
        for ((name, field), width) in fields(has_species).zip(row_shapes(grid, dimension)) {
            let element = group.create_group(&name)?;
            write_text_attribute(&element, "unit", field.unit)?;
            let storage = Storage { chunk: chunk(&width), compressed: false };
            series.push(Series::create_real(&element, "value", &width, &storage)?);
            match &clock {
                None => clock = Some(Clock::create(&element)?),
                Some(_) => link_clock(&group, &name)?,
            }
        }
        write_centers(&group, grid)?;
        let clock = clock.ok_or("no fields of profiles")?;
        Ok(Self { series, clock, pending: Vec::new() })
    }

    fn open(group: &Group) -> hdf5::Result<Self> {
        let has_species = group.link_exists(&format!("{OF_SPECIES}{}", FIELDS[0].name));
        let open = |(name, _): (String, &Field)| Series::open(group, &format!("{name}/value"));
        Ok(Self {
            series: fields(has_species).map(open).collect::<hdf5::Result<_>>()?,
            clock: Clock::open(&group.group(FIELDS[0].name)?)?,
            pending: Vec::new(),
        })
    }

    fn append(&mut self, row: &ProfileRow) -> hdf5::Result<()> {
        let of_all = FIELDS.iter().map(|field| (field.values)(&row.all));
        let of_species = FIELDS.iter().map(|field| row.species.iter().flat_map(field.values).collect());
        // Files without species have fewer series.
        for (series, values) in self.series.iter_mut().zip(of_all.chain(of_species)) {
            series.append(&values)?;
        }
        self.pending.push((row.step as i64, row.time));
        Ok(())
    }

    /// Adds the steps and times of the rows whose values have been flushed. Returns whether there were any.
    fn append_times(&mut self) -> hdf5::Result<bool> {
        let (steps, times): (Vec<i64>, Vec<f64>) = self.pending.drain(..).unzip();
        self.clock.step.append(&steps)?;
        self.clock.time.append(&times)?;
        Ok(!times.is_empty())
    }

    /// Number of rows up to `time`.
    fn rows_until(&self, time: f64) -> hdf5::Result<usize> {
        let rows = self.series.iter().map(Series::rows).fold(self.clock.rows(), usize::min);
        let rows = self.clock.time.without_trailing_nan(rows)?;
        let times = self.clock.time.read::<f64>(0, rows)?;
        Ok(times.partition_point(|&of_row| of_row <= time))
    }

    fn check_growth(&self, time: f64) -> hdf5::Result<()> {
        let kept = self.rows_until(time)?;
        self.series.iter().try_for_each(|series| series.check_growth::<f64>(kept))?;
        self.clock.check_growth(kept)
    }

    /// Drops the rows after `time`.
    fn truncate(&mut self, time: f64) -> hdf5::Result<()> {
        let kept = self.rows_until(time)?;
        self.clock.truncate(kept)?;
        self.series.iter_mut().try_for_each(|series| series.resize(kept))
    }
}

/// The species that a profile or a correlation has fields or curves of, as indices.
fn write_species(group: &Group, species: &[u32]) -> hdf5::Result<()> {
    group.new_attr_builder().with_data(species).create("species").map(drop)
}

/// The centers of the cells: `[bins]` for one axis, `[bins…][axes]` for several.
fn write_centers(group: &Group, grid: &Grid) -> hdf5::Result<()> {
    let element = group.create_group("position")?;
    write_text_attribute(&element, "unit", "length")?;
    link_clock(group, "position")?;
    let axes: Vec<Vec<f64>> = grid.axes.iter().map(haff_engine::GridAxis::centers).collect();
    let mut shape: Vec<usize> = axes.iter().map(Vec::len).collect();
    let cells: usize = shape.iter().product();
    let mut values = Vec::with_capacity(cells * axes.len());
    for cell in 0..cells {
        let mut below = cells;
        for axis in &axes {
            below /= axis.len();
            values.push(axis[cell / below % axis.len()]);
        }
    }
    if axes.len() > 1 {
        shape.push(axes.len());
    }
    let values = ndarray::ArrayViewD::from_shape(shape.clone(), &values)?;
    let dataset = element.new_dataset::<f64>().obj_track_times(false).shape(shape).create("value")?;
    dataset.write(values)
}

/// Gives an element the steps and times of the first field.
fn link_clock(group: &Group, name: &str) -> hdf5::Result<()> {
    ["step", "time"].into_iter().try_for_each(|part| {
        group.link_hard(&format!("{}/{part}", FIELDS[0].name), &format!("{name}/{part}"))
    })
}

/// All profiles of a file.
#[derive(Debug, Default)]
pub(crate) struct Profiles(Vec<Profile>);

impl Profiles {
    pub fn create(root: &Group, grids: &[Grid], dimension: usize) -> hdf5::Result<Self> {
        if grids.is_empty() {
            return Ok(Self::default());
        }
        let all = root.create_group("profiles")?;
        let create = |(index, grid): (usize, &Grid)| Profile::create(&all, index, grid, dimension);
        Ok(Self(grids.iter().enumerate().map(create).collect::<hdf5::Result<_>>()?))
    }

    pub fn open(root: &Group) -> hdf5::Result<Self> {
        if !root.link_exists("profiles") {
            return Ok(Self::default());
        }
        let mut found = Vec::new();
        for group in root.group("profiles")?.groups()? {
            let index = read_attribute::<u32>(&group.attr(INDEX)?, 1)?;
            found.push((index.first().copied(), Profile::open(&group)?));
        }
        found.sort_by_key(|(index, _)| *index);
        Ok(Self(found.into_iter().map(|(_, profile)| profile).collect()))
    }

    /// Shapes of the fields of each profile.
    pub fn row_shapes(&self) -> Vec<Vec<Vec<usize>>> {
        let of = |profile: &Profile| profile.series.iter().map(|series| series.shape().to_vec()).collect();
        self.0.iter().map(of).collect()
    }

    /// Number of profiles.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Appends the values of a row; it exists after [`Self::append_times`].
    pub fn append(&mut self, row: &ProfileRow) -> hdf5::Result<()> {
        match self.0.get_mut(row.profile) {
            Some(profile) => profile.append(row),
            None => Err(format!("there is no profile {}", row.profile).into()),
        }
    }

    /// Completes the rows whose values have been flushed. Returns whether there were any.
    pub fn append_times(&mut self) -> hdf5::Result<bool> {
        let mut appended = false;
        for profile in &mut self.0 {
            appended |= profile.append_times()?;
        }
        Ok(appended)
    }

    /// All datasets that grow, each with its number of rows up to `time`.
    pub fn series(&self, time: f64) -> hdf5::Result<Vec<(&Series, usize)>> {
        let mut found = Vec::new();
        for profile in &self.0 {
            let kept = profile.rows_until(time)?;
            let all = profile.series.iter().chain([&profile.clock.step, &profile.clock.time]);
            found.extend(all.map(|series| (series, kept)));
        }
        Ok(found)
    }

    /// Fails unless rows can be added after `time`.
    pub fn check_growth(&self, time: f64) -> hdf5::Result<()> {
        self.0.iter().try_for_each(|profile| profile.check_growth(time))
    }

    /// Drops the rows after `time`.
    pub fn truncate(&mut self, time: f64) -> hdf5::Result<()> {
        self.0.iter_mut().try_for_each(|profile| profile.truncate(time))
    }
}

/// The columns of a correlation.
#[derive(Debug)]
struct Columns {
    name: &'static str,
    lag: Series,
    value: Series,
    error: Series,
    count: Series,
}

/// All correlations of a file. They are replaced as a whole.
#[derive(Debug, Default)]
pub(crate) struct CorrelationTables(Vec<Columns>);

impl CorrelationTables {
    pub fn create(root: &Group, measured: &Correlations) -> hdf5::Result<Self> {
        if !measured.any() {
            return Ok(Self::default());
        }
        let all = root.create_group("correlations")?;
        let create = |kind: &CorrelationKind| -> hdf5::Result<Columns> {
            let group = all.create_group(kind.name)?;
            write_text_attribute(&group, "unit", kind.unit)?;
            let species = (kind.species)(measured);
            let curves = if species.is_empty() { Vec::new() } else { vec![species.len()] };
            if !species.is_empty() {
                write_species(&group, species)?;
            }
            let storage = Storage::plain(LAGS, &[]);
            let of_curves =
                |name: &str| Series::create_real(&group, name, &curves, &Storage::plain(LAGS, &curves));
            Ok(Columns {
                name: kind.name,
                lag: Series::create_real(&group, "lag", &[], &storage)?,
                value: of_curves("value")?,
                error: of_curves("error")?,
                count: Series::create::<i64>(&group, "count", &[], &storage)?,
            })
        };
        let kinds = CORRELATIONS.iter().filter(|kind| (kind.exists)(measured));
        Ok(Self(kinds.map(create).collect::<hdf5::Result<_>>()?))
    }

    pub fn open(root: &Group) -> hdf5::Result<Self> {
        if !root.link_exists("correlations") {
            return Ok(Self::default());
        }
        let all = root.group("correlations")?;
        let open = |kind: &CorrelationKind| -> hdf5::Result<Columns> {
            let group = all.group(kind.name)?;
            let column = |name: &str| Series::open(&group, name)?.expect(&[]);
            let value = Series::open(&group, "value")?;
            let error = Series::open(&group, "error")?.expect(value.shape())?;
            if value.shape().len() > 1 {
                return Err(format!("{} is no table of curves by lag", kind.name).into());
            }
            Ok(Columns { name: kind.name, lag: column("lag")?, value, error, count: column("count")? })
        };
        let found = CORRELATIONS.iter().filter(|kind| all.link_exists(kind.name));
        Ok(Self(found.map(open).collect::<hdf5::Result<_>>()?))
    }

    /// Fails unless all values can be replaced.
    pub fn check_growth(&self) -> hdf5::Result<()> {
        for Columns { lag, value, error, count, .. } in &self.0 {
            [lag, value, error].into_iter().try_for_each(|series| series.check_growth::<f64>(0))?;
            count.check_growth::<i64>(0)?;
        }
        Ok(())
    }

    /// Replaces all values.
    pub fn write(&mut self, correlations: &[Correlation]) -> hdf5::Result<()> {
        for columns in &mut self.0 {
            let Some(found) = correlations.iter().find(|found| found.name == columns.name) else { continue };
            let counts: Vec<i64> = found.count.iter().map(|&count| count as i64).collect();
            columns.lag.replace(&found.lag)?;
            columns.value.replace(&found.value)?;
            columns.error.replace(&found.error)?;
            columns.count.replace(&counts)?;
        }
        Ok(())
    }
}

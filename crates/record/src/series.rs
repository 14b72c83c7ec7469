//! Datasets that grow by rows.

use hdf5::{
    Dataset, Group, H5Type, Hyperslab, SliceOrIndex,
    types::{FixedAscii, OwnedDynValue},
};
use ndarray::{ArrayViewD, IxDyn};

use crate::{
    declared::{self, TIMES_AHEAD},
    growth::{check_series, cut_chunks},
    pack::{Number, Packer},
};

/// Rows per chunk of the small time series.
pub(crate) const SERIES_CHUNK: usize = 512;

/// A dataset [rows][width…] whose first axis is unlimited.
#[derive(Debug)]
pub(crate) struct Series {
    dataset: Dataset,
    rows: usize,
    width: Vec<usize>,
    /// Shape of a chunk.
    chunk: Vec<usize>,
    /// Chunks are shuffled and deflated, each written once, whole.
    compressed: bool,
}

/// How a [`Series`] is stored.
#[derive(Debug, Clone)]
pub(crate) struct Storage {
    /// Shape of a chunk.
    pub chunk: Vec<usize>,
    /// Shuffle and deflate: only for chunks that are written once, whole.
    pub compressed: bool,
}

impl Storage {
    /// Chunks of `rows` rows, uncompressed, which may be filled row by row.
    pub fn plain(rows: usize, width: &[usize]) -> Self {
        Self { chunk: shape(rows, width), compressed: false }
    }
}

fn shape(rows: usize, width: &[usize]) -> Vec<usize> {
    std::iter::once(rows).chain(width.iter().copied()).collect()
}

impl Series {
    /// A new, empty dataset.
    pub fn create<T: H5Type>(
        group: &Group,
        name: &str,
        width: &[usize],
        storage: &Storage,
    ) -> hdf5::Result<Self> {
        Self::build::<T>(group, name, width, storage, None)
    }

    /// A new, empty dataset of reals. Rows that a kill during a flush has added to its extent, but whose
    /// chunk is not in the index on disk, read as NaN.
    pub fn create_real(group: &Group, name: &str, width: &[usize], storage: &Storage) -> hdf5::Result<Self> {
        Self::build::<f64>(group, name, width, storage, Some(OwnedDynValue::new(f64::NAN)))
    }

    fn build<T: H5Type>(
        group: &Group,
        name: &str,
        width: &[usize],
        storage: &Storage,
        fill: Option<OwnedDynValue>,
    ) -> hdf5::Result<Self> {
        let extents: Vec<hdf5::Extent> = std::iter::once(hdf5::Extent::resizable(0))
            .chain(width.iter().map(|&size| hdf5::Extent::fixed(size)))
            .collect();
        let mut builder = group.new_dataset::<T>().chunk(storage.chunk.clone()).obj_track_times(false);
        if storage.compressed {
            // Chunks are compressed by `Packer`; the level is for information.
            builder = builder.shuffle().deflate(1);
        }
        if let Some(fill) = fill {
            builder = builder.fill_value(fill);
        }
        let dataset = builder.shape(extents).create(name)?;
        let mut series = Self {
            dataset,
            rows: 0,
            width: width.to_vec(),
            chunk: storage.chunk.clone(),
            compressed: storage.compressed,
        };
        series.create_index::<T>()?;
        Ok(series)
    }

    /// Creates the index of the chunks, by writing a chunk and removing it. A later flush then need not write
    /// both a new index and the header that points to it, between which a process could be killed.
    fn create_index<T: H5Type>(&mut self) -> hdf5::Result<()> {
        self.resize(1)?;
        let corner = || Hyperslab::from(vec![SliceOrIndex::from(0..1); 1 + self.width.len()]);
        let element = self.dataset.read_slice::<T, _, IxDyn>(corner())?;
        self.dataset.write_slice(&element, corner())?;
        self.resize(0)
    }

    /// An existing dataset.
    pub fn open(group: &Group, name: &str) -> hdf5::Result<Self> {
        let dataset = group.dataset(name)?;
        let shape = dataset.get_shape()?;
        let Some((&rows, width)) = shape.split_first() else {
            return Err(format!("{} is a scalar", dataset.name()).into());
        };
        declared::check_growing(&dataset)?;
        let compressed = !dataset.filters().is_empty();
        let chunk = dataset.chunk().unwrap_or_default();
        Ok(Self { rows, width: width.to_vec(), chunk, compressed, dataset })
    }

    /// Fails if the rows have another shape.
    pub fn expect(self, width: &[usize]) -> hdf5::Result<Self> {
        if self.width == width {
            Ok(self)
        } else {
            Err(format!("{} has rows of {:?} instead of {width:?}", self.dataset.name(), self.width).into())
        }
    }

    /// Fails unless rows of `T` can be added after the first `kept` ones.
    pub fn check_growth<T: H5Type>(&self, kept: usize) -> hdf5::Result<()> {
        check_series::<T>(&self.dataset, &self.width, kept)
    }

    /// Parts of the file, as places and sizes, that change when rows after the first `kept` ones are dropped.
    pub fn cut_chunks(&self, kept: usize) -> hdf5::Result<Vec<(u64, usize)>> {
        if kept < self.rows { cut_chunks(&self.dataset, kept) } else { Ok(Vec::new()) }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether chunks of another length are written one by one.
    pub fn is_off(&self, rows: usize) -> bool {
        self.compressed && self.chunk.first() != Some(&rows)
    }

    /// Path in the file.
    pub fn name(&self) -> String {
        self.dataset.name()
    }

    /// Shape of a row.
    pub fn shape(&self) -> &[usize] {
        &self.width
    }

    /// Numbers per row.
    pub fn width(&self) -> usize {
        self.width.iter().product()
    }

    /// Appends rows; `data` contains whole rows.
    pub fn append<T: H5Type>(&mut self, data: &[T]) -> hdf5::Result<()> {
        let count = data.len() / self.width();
        if count * self.width() != data.len() {
            return Err(format!("{}: {} numbers are no whole rows", self.dataset.name(), data.len()).into());
        }
        if count == 0 {
            return Ok(());
        }
        self.resize(self.rows + count)?;
        self.write(self.rows - count, data)
    }

    /// Appends `count` rows, at most a chunk, at the start of a chunk: a whole one, or the last of the
    /// dataset.
    pub fn append_chunk<T: Number>(
        &mut self,
        count: usize,
        values: impl Iterator<Item = T>,
        packer: &mut Packer,
    ) -> hdf5::Result<()> {
        if !self.compressed {
            return self.append(&values.collect::<Vec<_>>());
        }
        let mut corner = vec![0; self.chunk.len()];
        corner[0] = self.rows;
        let chunk = packer.pack(values, self.chunk.iter().product())?;
        self.resize(self.rows + count)?;
        self.write_chunk(&corner, chunk)
    }

    /// Appends rows of N numbers each, of which a chunk has one if it is compressed.
    pub fn append_rows<T: Number>(
        &mut self,
        rows: impl Iterator<Item = impl Iterator<Item = T>>,
        packer: &mut Packer,
    ) -> hdf5::Result<()> {
        if !self.compressed {
            // Many small rows at once.
            return self.append(&rows.flatten().collect::<Vec<_>>());
        }
        for row in rows {
            self.append_chunk(1, row, packer)?;
        }
        Ok(())
    }

    /// Appends rows of N vectors each.
    pub fn append_vectors<'a, V: Copy + 'a, T: Number>(
        &mut self,
        rows: impl Iterator<Item = &'a [V]>,
        components: impl Fn(V) -> [T; 3],
        packer: &mut Packer,
    ) -> hdf5::Result<()> {
        if !self.compressed {
            // Many small rows at once.
            return self.append(&rows.flatten().flat_map(|&vector| components(vector)).collect::<Vec<_>>());
        }
        let &[1, block, 3] = self.chunk.as_slice() else {
            return Err(format!("{} has chunks of {:?}", self.dataset.name(), self.chunk).into());
        };
        for vectors in rows {
            let row = self.rows;
            self.resize(row + 1)?;
            for (k, part) in vectors.chunks(block.max(1)).enumerate() {
                let chunk = packer.pack(part.iter().flat_map(|&vector| components(vector)), 3 * block)?;
                self.write_chunk(&[row, k * block, 0], chunk)?;
            }
        }
        Ok(())
    }

    /// Writes a chunk as it is to be stored in the file, bypassing HDF5's filters.
    fn write_chunk(&self, corner: &[usize], chunk: &[u8]) -> hdf5::Result<()> {
        if corner.iter().zip(&self.chunk).any(|(corner, size)| !corner.is_multiple_of(*size)) {
            return Err(format!(
                "{}: no chunk of {:?} begins at {corner:?}",
                self.dataset.name(),
                self.chunk
            )
            .into());
        }
        let corner: Vec<u64> = corner.iter().map(|&corner| corner as u64).collect();
        // HDF5's safe interface has no such call, and its own filters take eight times as long (see `pack`).
        // Tests read the chunks back through these filters.
        let write = || {
            // SAFETY: the dataset is open as long as `self`; `corner` has an entry for each of its axes, as
            // `chunk` has; HDF5 reads `chunk.len()` bytes and keeps neither pointer; `sync` holds the
            // library's lock.
            unsafe {
                hdf5_sys::h5d::H5Dwrite_chunk(
                    self.dataset.id(),
                    hdf5_sys::h5p::H5P_DEFAULT,
                    0,
                    corner.as_ptr(),
                    chunk.len(),
                    chunk.as_ptr().cast(),
                )
            }
        };
        hdf5::sync::sync(|| hdf5::h5check(write()))?;
        Ok(())
    }

    /// Replaces whole existing rows, from row `start`.
    pub fn write<T: H5Type>(&self, start: usize, data: &[T]) -> hdf5::Result<()> {
        let count = data.len() / self.width();
        let view = ArrayViewD::from_shape(IxDyn(&shape(count, &self.width)), data)?;
        self.dataset.write_slice(view, self.select(start, start + count))
    }

    /// Replaces all rows.
    pub fn replace<T: H5Type>(&mut self, data: &[T]) -> hdf5::Result<()> {
        self.resize(data.len() / self.width())?;
        if data.is_empty() { Ok(()) } else { self.write(0, data) }
    }

    /// Reads rows `start..end`, flat.
    pub fn read<T: H5Type>(&self, start: usize, end: usize) -> hdf5::Result<Vec<T>> {
        declared::check_rows(&self.dataset, end.saturating_sub(start), self.width(), None)?;
        let array = self.dataset.read_slice::<T, _, IxDyn>(self.select(start, end))?;
        Ok(array.into_raw_vec_and_offset().0)
    }

    /// Number of rows up to `rows`, without NaN at the end: for times.
    pub fn without_trailing_nan(&self, rows: usize) -> hdf5::Result<usize> {
        let mut end = rows.min(self.rows);
        // Rows without stored data read as NaN: the search must not read billions of them.
        declared::check_rows(&self.dataset, end, self.width(), Some(TIMES_AHEAD))?;
        while end > 0 {
            let start = end.saturating_sub(1 << 12);
            let block = self.read::<f64>(start, end)?;
            if let Some(last) = block.iter().rposition(|time| !time.is_nan()) {
                return Ok(start + last + 1);
            }
            end = start;
        }
        Ok(0)
    }

    /// Sets the number of rows. Shrinking frees whole chunks.
    pub fn resize(&mut self, rows: usize) -> hdf5::Result<()> {
        if rows != self.rows {
            self.dataset.resize(shape(rows, &self.width))?;
            self.rows = rows;
        }
        Ok(())
    }

    fn select(&self, start: usize, end: usize) -> Hyperslab {
        let dims: Vec<SliceOrIndex> = std::iter::once(SliceOrIndex::from(start..end))
            .chain(self.width.iter().map(|&size| SliceOrIndex::from(0..size)))
            .collect();
        Hyperslab::from(dims)
    }
}

/// A name of fixed length, for datasets of names.
pub(crate) type Name = FixedAscii<64>;

//! Checks that a file can contain what its datasets declare, before memory is allocated for it. A damaged
//! file may declare any shape; the stored data cannot be larger than the file.

use hdf5::{Attribute, Container, Dataset, H5Type};

/// Largest expansion by deflate.
const EXPANSION: u64 = 1032;
/// Reads up to this size are not checked [bytes].
const SMALL: u64 = 1 << 20;
/// Size that a dataset may declare beyond its stored data [bytes]. A kill during a flush leaves such a shape;
/// the bound is far more than is written between two flushes.
const AHEAD: u64 = 4 << 30;
/// The same for a column of times [bytes].
pub(crate) const TIMES_AHEAD: u64 = 64 << 20;
/// Largest accepted chunk, ten times haff's largest [bytes].
const LARGEST_CHUNK: u64 = 16 << 20;
/// Largest accepted element, ten times haff's largest, a row of events [bytes].
const LARGEST_ELEMENT: usize = 1024;

/// Fails if elements or chunks are larger than haff writes. Returns the size of an element [bytes].
fn check_layout(dataset: &Dataset) -> hdf5::Result<u64> {
    let element = dataset.dtype()?.size();
    if element == 0 || element > LARGEST_ELEMENT {
        let text = format!(
            "{} has elements of {element} bytes, haff's have up to {LARGEST_ELEMENT}",
            dataset.name()
        );
        return Err(text.into());
    }
    let element = element as u64;
    if let Some(chunk) = dataset.chunk() {
        let bytes = chunk.iter().fold(element, |bytes, &size| bytes.saturating_mul(size as u64));
        if bytes == 0 || bytes > LARGEST_CHUNK {
            let text = format!("{} has chunks of {chunk:?}, which haff does not write", dataset.name());
            return Err(text.into());
        }
    }
    Ok(element)
}

/// Fails if the stored data of a dataset cannot hold `elements`. `slack`: bytes that may be missing.
fn check_elements(dataset: &Dataset, elements: u64, slack: u64) -> hdf5::Result<()> {
    let bytes = elements.saturating_mul(check_layout(dataset)?);
    if bytes <= slack {
        return Ok(());
    }
    let stored = dataset.storage_size().min(dataset.file()?.size());
    let most = if dataset.filters().is_empty() { stored } else { stored.saturating_mul(EXPANSION) };
    if bytes - slack > most {
        let shape = dataset.get_shape()?;
        let text = format!(
            "{} declares {shape:?} elements, of which {elements} would take {bytes} bytes; the {stored} bytes stored for it hold at most {most}",
            dataset.name()
        );
        return Err(text.into());
    }
    Ok(())
}

/// Fails if the declared shape of a growing dataset is larger than any run can leave.
pub(crate) fn check_growing(dataset: &Dataset) -> hdf5::Result<()> {
    check_elements(dataset, elements(&dataset.get_shape()?), AHEAD)
}

/// Fails if a dataset cannot hold `rows` rows of `width` elements, before they are read. `slack`: bytes that
/// may be missing, by default those of a small read.
pub(crate) fn check_rows(
    dataset: &Dataset,
    rows: usize,
    width: usize,
    slack: Option<u64>,
) -> hdf5::Result<()> {
    check_elements(dataset, (rows as u64).saturating_mul(width as u64), slack.unwrap_or(SMALL))
}

/// Reads all elements of a dataset.
pub(crate) fn read_all<T: H5Type>(dataset: &Dataset) -> hdf5::Result<Vec<T>> {
    check_elements(dataset, elements(&dataset.get_shape()?), SMALL)?;
    dataset.read_raw()
}

/// Reads a scalar dataset.
pub(crate) fn read_scalar<T: H5Type>(dataset: &Dataset) -> hdf5::Result<T> {
    check_layout(dataset)?;
    dataset.read_scalar()
}

/// Reads the `count` elements of an attribute.
pub(crate) fn read_attribute<T: H5Type>(attribute: &Attribute, count: usize) -> hdf5::Result<Vec<T>> {
    let (found, element) = (elements(&attribute.get_shape()?), Container::dtype(attribute)?.size());
    if found != count as u64 || element > LARGEST_ELEMENT {
        return Err(format!(
            "{} has {found} elements of {element} bytes instead of {count}",
            attribute.name()
        )
        .into());
    }
    attribute.read_raw()
}

/// A text in a file, which may be damaged: strings of the HDF5 library are not checked to be UTF-8.
pub(crate) fn checked_text(bytes: &[u8], name: &str) -> hdf5::Result<String> {
    String::from_utf8(bytes.to_vec()).map_err(|error| format!("{name} is not UTF-8 text: {error}").into())
}

/// Number of elements of a shape.
pub(crate) fn elements(shape: &[usize]) -> u64 {
    shape.iter().fold(1, |elements: u64, &size| elements.saturating_mul(size as u64))
}

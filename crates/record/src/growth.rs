//! Checks that a file can be continued, before any byte of it is changed: each dataset that grows is stored
//! as this crate stores it, and no two datasets share space.

use hdf5::{
    Dataset, Group, H5Type, LocationToken, LocationType, dataset::Layout, filters::Filter,
    types::TypeDescriptor,
};

use crate::declared::checked_text;

/// Where data of a dataset are in the file.
struct Extent {
    start: u64,
    size: u64,
    /// Index of the dataset.
    dataset: usize,
}

/// Fails unless a dataset can take more rows of `T`. `columns` is the shape of a row; `kept` rows must be
/// stored.
pub(crate) fn check_series<T: H5Type>(dataset: &Dataset, columns: &[usize], kept: usize) -> hdf5::Result<()> {
    let wrong = |what: String| -> hdf5::Result<()> { Err(format!("{}: {what}", dataset.name()).into()) };
    if !holds::<T>(dataset)? {
        return wrong(format!("holds other values than {:?}", T::type_descriptor()));
    }
    let Some(chunk) = dataset.chunk().filter(|chunk| chunk.len() == 1 + columns.len()) else {
        return wrong("is not stored in chunks".to_owned());
    };
    let growing: Vec<_> = std::iter::once(None).chain(columns.iter().copied().map(Some)).collect();
    if dataset.space()?.maxdims() != growing {
        return wrong(format!("has the limits {:?} instead of {growing:?}", dataset.space()?.maxdims()));
    }
    if !matches!(dataset.filters()[..], [] | [Filter::Shuffle, Filter::Deflate(_)]) {
        return wrong(format!("is packed by {:?}", dataset.filters()));
    }
    let mut stored = 0_u64;
    dataset.chunks_visit(|info| {
        stored += u64::from(info.offset[0] < kept as u64);
        0
    })?;
    let chunks = |(&length, &part): (&usize, &usize)| length.div_ceil(part.max(1)) as u64;
    let expected = chunks((&kept, &chunk[0])) * columns.iter().zip(&chunk[1..]).map(chunks).product::<u64>();
    if stored != expected {
        return wrong(format!("has {stored} of the {expected} chunks with its first {kept} rows"));
    }
    Ok(())
}

/// Whether the elements of a dataset are stored as `T`, or as an enum that `T` extends.
fn holds<T: H5Type>(dataset: &Dataset) -> hdf5::Result<bool> {
    let (found, expected) = (dataset.dtype()?, hdf5::Datatype::from_type::<T>()?);
    if let (TypeDescriptor::Enum(found), TypeDescriptor::Enum(expected)) =
        (found.to_descriptor()?, expected.to_descriptor()?)
    {
        let known = found.members.iter().all(|member| expected.members.contains(member));
        return Ok(known && (found.size, found.signed) == (expected.size, expected.signed));
    }
    Ok(found == expected)
}

/// Fails unless a dataset of fixed size holds `T`, in one piece.
pub(crate) fn check_fixed<T: H5Type>(dataset: &Dataset) -> hdf5::Result<()> {
    let stored_as_expected = holds::<T>(dataset)?
        && dataset.layout() == Layout::Contiguous
        && dataset.offset().is_some()
        && dataset.storage_size() == (dataset.size() * size_of::<T>()) as u64;
    if stored_as_expected {
        Ok(())
    } else {
        Err(format!("{} is not stored as a run stores it", dataset.name()).into())
    }
}

/// Places and sizes of the chunks with rows up to `kept` and beyond it, which HDF5 changes when it drops the
/// latter.
pub(crate) fn cut_chunks(dataset: &Dataset, kept: usize) -> hdf5::Result<Vec<(u64, usize)>> {
    let mut found = Vec::new();
    let rows = dataset.chunk().and_then(|chunk| chunk.first().copied()).unwrap_or(1).max(1) as u64;
    let kept = kept as u64;
    dataset.chunks_visit(|info| {
        if info.offset[0] < kept && kept < info.offset[0] + rows {
            found.push((info.addr, info.size as usize));
        }
        0
    })?;
    Ok(found)
}

/// Fails if data of two datasets of a file of `size` bytes overlap, or are not within the file.
pub(crate) fn check_extents(root: &Group, size: u64) -> hdf5::Result<()> {
    let (mut extents, mut datasets) = (Vec::new(), Vec::new());
    for dataset in all_datasets(root)? {
        add_extents(&dataset, datasets.len(), &mut extents)?;
        datasets.push(dataset.name());
    }
    extents.sort_by_key(|extent| extent.start);
    let mut last: Option<&Extent> = None;
    for extent in &extents {
        let name = &datasets[extent.dataset];
        if extent.start.checked_add(extent.size).is_none_or(|end| end > size) {
            let text = format!("{name} has data at {}, behind the end of the file", extent.start);
            return Err(text.into());
        }
        if let Some(before) = last.filter(|before| before.start + before.size > extent.start) {
            let other = &datasets[before.dataset];
            return Err(format!("{name} has data at {}, where those of {other} are", extent.start).into());
        }
        last = Some(extent);
    }
    Ok(())
}

fn add_extents(dataset: &Dataset, number: usize, extents: &mut Vec<Extent>) -> hdf5::Result<()> {
    let wrong = |what: &str| -> hdf5::Result<()> { Err(format!("{}: {what}", dataset.name()).into()) };
    if !dataset.is_chunked() {
        if let Some(start) = dataset.offset() {
            extents.push(Extent { start, size: dataset.storage_size(), dataset: number });
        }
        return Ok(());
    }
    let chunk = dataset.chunk().unwrap_or_default();
    let bytes = (chunk.iter().product::<usize>() * dataset.dtype()?.size()) as u64;
    let plain = dataset.filters().is_empty();
    let (mut before, mut fault) = (None::<Vec<u64>>, None);
    dataset.chunks_visit(|info| {
        let aligned =
            info.offset.iter().zip(&chunk).all(|(at, part)| at.is_multiple_of((*part).max(1) as u64));
        if !aligned || before.as_deref().is_some_and(|before| before >= info.offset) {
            fault = Some("has chunks out of order");
        } else if info.filter_mask != 0 || (plain && info.size != bytes) {
            fault = Some("has chunks of another size than declared");
        }
        before = Some(info.offset.to_vec());
        extents.push(Extent { start: info.addr, size: info.size, dataset: number });
        i32::from(fault.is_some())
    })?;
    fault.map_or(Ok(()), wrong)
}

/// Every dataset of a file, once.
fn all_datasets(root: &Group) -> hdf5::Result<Vec<Dataset>> {
    let mut known: Vec<LocationToken> = Vec::new();
    let (mut groups, mut found) = (vec![root.clone()], Vec::new());
    while let Some(group) = groups.pop() {
        for name in group.member_names()? {
            let name = checked_text(&name.into_bytes(), "the name of a dataset")?;
            let about = group.loc_info_by_name(&name)?;
            if known.contains(&about.token) {
                continue;
            }
            known.push(about.token);
            match about.loc_type {
                LocationType::Group => groups.push(group.group(&name)?),
                LocationType::Dataset => found.push(group.dataset(&name)?),
                _ => {}
            }
        }
    }
    Ok(found)
}
